"""What casters let through: which triangles are of which kind, and the oracle's shares of light against rationals."""

from fractions import Fraction

import numpy as np
import pytest

from truth import factors, lets_through, random_samples, rational_transmittance, share
from umbrae import InputError, Light, Material, Scene, ViewSamples, shadow
from umbrae.geometry import predicates
from umbrae.methods.oracle import Exact, Oracle
from umbrae.methods.oracle_transmission import Product
from umbrae.transmission import CLEAR, EVEN, SOLID, VARYING, transmission_of

CORNERS = [(0, 0, 0), (1, 0, 0), (0, 0, 1)]
UV = [(0, 0), (1, 0), (0, 1)]
WHITE = (1.0, 1.0, 1.0, 1.0)


def one(material, colors=None, uv=None):
    """A single triangle of a material."""
    return Scene(CORNERS, [(0, 1, 2)], material, uv=uv, colors=colors)


def texture(*texels):
    """A row of texels."""
    return np.array([texels], np.uint8)


def kind_of(scene):
    table = transmission_of(scene)
    return SOLID if table is None else table.kind[0]


# Kinds


@pytest.mark.parametrize(
    ("fields", "kind"),
    [
        ({}, SOLID),
        ({"base_color": (1, 1, 1, 0)}, SOLID),  # OPAQUE does not look at alpha
        ({"texture": texture((0, 0, 0, 0))}, SOLID),
        ({"transmission": 0.5}, EVEN),
        ({"transmission": 1.0, "base_color": WHITE}, CLEAR),
        ({"transmission": 1.0, "base_color": (0, 0, 0, 1)}, SOLID),
        ({"transmission": 1.0, "base_color": (1, 0, 0, 1)}, EVEN),
        ({"transmission": 1.0, "base_color": (1, 1, 1, 0)}, CLEAR),
        ({"alpha_mode": "BLEND"}, SOLID),
        ({"alpha_mode": "BLEND", "base_color": (1, 1, 1, 0)}, CLEAR),
        ({"alpha_mode": "BLEND", "base_color": (1, 1, 1, 0.5)}, EVEN),
        ({"alpha_mode": "BLEND", "base_color": (1, 1, 1, 0.5), "transmission": 1.0}, CLEAR),
        ({"alpha_mode": "MASK", "base_color": (1, 1, 1, 0.5)}, SOLID),  # at the cut-off it is there
        ({"alpha_mode": "MASK", "base_color": (1, 1, 1, 0.49)}, CLEAR),
        ({"alpha_mode": "MASK", "alpha_cutoff": 0.0, "base_color": (1, 1, 1, 0)}, SOLID),
        ({"alpha_mode": "MASK", "transmission": 0.5}, EVEN),
        ({"alpha_mode": "MASK", "texture": texture((0, 0, 0, 128), (9, 9, 9, 255))}, SOLID),
        ({"alpha_mode": "MASK", "texture": texture((0, 0, 0, 0), (9, 9, 9, 127))}, CLEAR),
        ({"alpha_mode": "MASK", "texture": texture((0, 0, 0, 0), (0, 0, 0, 255))}, VARYING),
        ({"alpha_mode": "BLEND", "texture": texture((0, 0, 0, 255), (9, 9, 9, 255))}, SOLID),
        ({"alpha_mode": "BLEND", "texture": texture((0, 0, 0, 0), (9, 9, 9, 0))}, CLEAR),
        ({"alpha_mode": "BLEND", "texture": texture((0, 0, 0, 51), (9, 9, 9, 51))}, EVEN),
        ({"alpha_mode": "BLEND", "texture": texture((0, 0, 0, 51), (0, 0, 0, 52))}, VARYING),
        ({"transmission": 1.0, "texture": texture((0, 0, 0, 9), (0, 0, 0, 8))}, SOLID),
        ({"transmission": 1.0, "texture": texture((9, 0, 0, 9), (9, 0, 0, 8))}, EVEN),
        ({"transmission": 1.0, "texture": texture((9, 0, 0, 9), (8, 0, 0, 9))}, VARYING),
        ({"transmission": 1.0, "base_color": WHITE, "texture": texture((255, 255, 255, 0))}, CLEAR),
    ],
)
def test_kinds(fields, kind):
    material = Material(**fields)
    # Textures that are the same everywhere need no coordinates.
    assert kind_of(one(material, uv=UV if kind == VARYING else None)) == kind
    # White vertex colours change nothing.
    assert kind_of(one(material, colors=[WHITE] * 3, uv=UV)) == kind


@pytest.mark.parametrize(
    ("fields", "color", "kind"),
    [
        ({}, (0, 0, 0, 0), SOLID),
        ({"transmission": 1.0, "base_color": (0, 0, 0, 1)}, (1, 0, 0, 0.5), SOLID),  # black stays black
        ({"transmission": 1.0, "base_color": WHITE}, (1, 0, 0, 1), VARYING),  # clear glass does not stay clear
        ({"transmission": 1.0, "base_color": WHITE}, (1, 1, 1, 0), CLEAR),  # OPAQUE does not look at alpha
        ({"transmission": 0.5}, (1, 1, 1, 0), EVEN),
        ({"transmission": 0.5}, (1, 1, 0.5, 1), VARYING),
        ({"alpha_mode": "BLEND"}, (0, 0, 0, 1), SOLID),  # nothing of a colour passes
        ({"alpha_mode": "BLEND"}, (1, 1, 1, 0.5), VARYING),
        ({"alpha_mode": "BLEND", "base_color": (1, 1, 1, 0)}, (1, 0, 0, 0.5), CLEAR),
        ({"alpha_mode": "BLEND", "base_color": (1, 1, 1, 0.5)}, (0, 0, 0, 1), EVEN),
        ({"alpha_mode": "MASK"}, (1, 1, 1, 0.5), VARYING),
        ({"alpha_mode": "MASK"}, (0, 0, 0, 1), SOLID),
    ],
)
def test_kinds_with_vertex_colors(fields, color, kind):
    assert kind_of(one(Material(**fields), colors=[WHITE, WHITE, color])) == kind


def test_even_shares():
    leaf = texture((255, 0, 188, 51))
    for fields, passes in (
        ({"base_color": (0.5, 0.25, 1, 0.125), "transmission": 0.5}, (0.25, 0.125, 0.5)),
        ({"base_color": (0.5, 0.25, 1, 0.5), "transmission": 0.5, "alpha_mode": "BLEND"}, (0.625, 0.5625, 0.75)),
        ({"base_color": (1, 1, 1, 0.5), "alpha_mode": "BLEND", "texture": leaf}, (0.9, 0.9, 0.9)),
        ({"base_color": (0.5, 1, 1, 1), "transmission": 1.0, "texture": leaf}, (0.5, 0.0, 0.502886)),
    ):
        table = transmission_of(one(Material(**fields)))
        np.testing.assert_allclose(table.even[0], passes, rtol=1e-6)


def test_opaque_wherever_it_is_there():
    modes = [("OPAQUE", 0.0), ("OPAQUE", 0.5), ("MASK", 0.0), ("MASK", 0.5), ("BLEND", 0.0)]
    materials = [Material((1, 1, 1, 0.75), mode, transmission=t) for mode, t in modes]
    scene = Scene(CORNERS, [(0, 1, 2)] * 5, materials, range(5))
    assert transmission_of(scene).closed.tolist() == [False, False, True, False, False]


def test_a_texture_that_decides_needs_coordinates():
    holes = Material(alpha_mode="MASK", texture=texture((0, 0, 0, 0), (0, 0, 0, 255)), name="leaves")
    for make in (transmission_of, Oracle().prepare):
        with pytest.raises(InputError, match=r"^material 1 \('leaves'\): .*no texture coordinates") as caught:
            make(Scene(CORNERS, [(0, 1, 2)], [Material(), holes], [1]))
        assert "\n" not in str(caught.value)
    # Not where no triangle has it, and not where it does not matter.
    assert transmission_of(Scene(CORNERS, [(0, 1, 2)], [Material(), holes])) is None
    assert transmission_of(Scene(CORNERS, [(0, 1, 2)], [Material(texture=holes.texture)])) is None


@pytest.mark.parametrize(
    "material",
    [
        Material((1, 1, 1, 0.9), "BLEND", texture=texture((9, 50, 200, 128), (90, 5, 20, 128))),
        Material((1, 0.9, 0.8, 1), transmission=0.8, texture=texture((9, 50, 200, 128), (9, 50, 200, 1))),
        Material((1, 1, 1, 0.9), "MASK", 0.3, texture=texture((9, 50, 200, 128), (90, 5, 20, 128))),
    ],
)
def test_a_texture_that_is_the_same_where_it_matters_needs_no_coordinates(material):
    # Vertex colours decide; the texture's factor is one number.
    rng = np.random.default_rng(1)
    colors = np.array([(1, 1, 1, 1), (0.5, 1, 0.2, 0.2), (0.1, 0.3, 1, 0.7)], np.float32)
    scene = Scene(CORNERS, [(0, 1, 2)], [material], colors=colors)
    assert transmission_of(scene).kind.tolist() == [VARYING]
    a, b, c = CORNERS
    u, v = rng.uniform(0, 0.5, (2, 50, 1))
    light = Light.directional(np.cross(np.subtract(b, a), np.subtract(c, a)).astype(float))
    samples = ViewSamples.points((a + u * np.subtract(b, a) + v * np.subtract(c, a)) - light.position[:3] / 4)
    truth = rational_transmittance(scene, light, samples)
    for method in ("frustum", "oracle"):
        np.testing.assert_allclose(shadow(scene, light, samples, method).transmittance, truth, rtol=0, atol=1e-5)
    assert len(np.unique(truth.round(3))) > (1 if material.alpha_mode == "MASK" else 20)
    # It matters if vertex colours can take it to the other side of the cut-off.
    uneven = Material(alpha_mode="MASK", texture=texture((0, 0, 0, 200), (0, 0, 0, 255)))
    with pytest.raises(InputError, match="no texture coordinates"):
        transmission_of(Scene(CORNERS, [(0, 1, 2)], [uneven], colors=colors))


# The oracle against rationals


def glazed(rng, positions, triangles):
    """The triangles with all kinds of materials, textures and vertex colours."""
    noise = rng.integers(0, 256, (3, 5, 4)).astype(np.uint8)
    holes = noise.copy()
    holes[..., 3] = np.where(holes[..., 3] < 128, 0, 255)
    materials = [
        Material(),
        Material((0.2, 0.4, 0.6, 0.5), "BLEND"),
        Material((1.0, 0.5, 0.25, 1.0), transmission=1.0),
        Material((1.0, 0.5, 0.25, 0.7), "BLEND", transmission=0.6),
        Material((1, 1, 1, 0), "BLEND"),
        Material(WHITE, "MASK", texture=holes),
        Material(WHITE, "MASK", 0.3, 1.0, texture=noise),
        Material(WHITE, "BLEND", texture=noise),
        Material((0.9, 1.0, 1.0, 1.0), transmission=0.9, texture=noise),
    ]
    vertices = len(positions)
    return Scene(
        positions,
        triangles,
        materials,
        rng.choice(len(materials), len(triangles), p=[0.04, *[0.12] * 8]),
        uv=rng.integers(-16, 17, (vertices, 2)) / 8,
        colors=np.where(rng.random((vertices, 1)) < 0.7, 1.0, rng.integers(4, 9, (vertices, 4)) / 8),
    )


def glazed_lattice(rng, count):
    """Full of coincidences: shared vertices and edges, coplanar, coincident and degenerate triangles."""
    positions = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3), axis=-1).reshape(-1, 3) * 2
    triangles = rng.integers(0, len(positions), (count, 3))
    triangles[: count // 8] = triangles[count // 8 : 2 * (count // 8), ::-1]
    return glazed(rng, positions.astype(np.float32), triangles)


def glazed_crowd(rng, count):
    """Triangles of random place and shape, some of them slivers."""
    centers = np.repeat(rng.uniform(-1, 1, (count, 3)), 3, axis=0)
    spread = rng.choice([0.7, 0.2, 1e-3], (3 * count, 1), p=[0.8, 0.15, 0.05])
    positions = (centers + spread * rng.uniform(-1, 1, (3 * count, 3))).astype(np.float32)
    return glazed(rng, positions, np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize("soup", [glazed_lattice, glazed_crowd])
@pytest.mark.parametrize("position", [(0, 5, 0, 1), (1, 1, 1, 0), (3, -2, 1, 1), (0, 0, 1, 0), (0.1, 0.2, 0.05, 1)])
def test_shares_of_light_agree_with_rationals(soup, position):
    rng = np.random.default_rng(21)
    scene, light = soup(rng, 40), Light(np.array(position))
    free = ViewSamples.points(rng.integers(-5, 6, (30, 3)) / 2)
    partly = 0
    for samples in (random_samples(rng, scene, 60), free):
        mask, lowest, highest = Oracle().prepare(scene).decide(light, samples)
        truth = rational_transmittance(scene, light, samples)
        # Float32 rounds the truth as it does the ends.
        single = truth.astype(np.float32)
        assert (lowest <= single).all() and (single <= highest).all()
        known = (highest - lowest <= 2.0**-23).all(axis=1)
        assert known.mean() > 0.9
        np.testing.assert_allclose(mask.transmittance[known], truth[known], 0, 2.0**-23)
        np.testing.assert_array_equal(mask.in_shadow[known], (truth[known] == 0).all(axis=1))
        partly += int(((truth > 0) & (truth < 1)).any(axis=1).sum())
        all_asked = Oracle(tree=False).prepare(scene).shadow(light, samples)
        np.testing.assert_array_equal(all_asked.transmittance, mask.transmittance)
    assert partly >= 10


@pytest.mark.parametrize("scale", [1.0, 1e14, 1e-15])
@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_the_exact_share_of_each_caster_lies_between_the_ends(scale, shift):
    # Far from zero float64 loses digits: the ends must move apart, and still not too far.
    rng = np.random.default_rng(8)
    scene = glazed_crowd(rng, 60)
    scene = Scene(
        scale * (scene.positions + np.float32(shift)).astype(np.float32),
        scene.triangles, scene.materials, scene.material_id, uv=scene.uv, colors=scene.colors,
    )  # fmt: skip
    asked = widest = 0
    for position in ((0.5, 4.0, 1.0, 1.0), (0.3, 1.0, -0.2, 0.0)):
        place = np.array(position)
        place[:3] = scale * (place[:3] + shift * position[3])
        light = Light(place)
        samples = random_samples(rng, scene, 75)
        exact, kind = Exact(scene, light), transmission_of(scene).kind
        for index in range(samples.size):
            for t in np.flatnonzero((kind == EVEN) | (kind == VARYING)).tolist():
                if not exact.shades(samples, index, t, closed=False):
                    continue
                product = Product(scene, kind, np.tile(light.position, (samples.size, 1)), samples)
                product.multiply(np.array([[index, t]], np.int64))
                value, lowest, highest = ([Fraction(x) for x in left[index]] for left in product.left)
                right = share(scene, light, samples, index, t)
                for low, x, middle, high in zip(lowest, right, value, highest, strict=True):
                    # What is left are the roundings of (1 - a) + a t c itself.
                    rounding = Fraction(2.0**-51)
                    assert low - rounding <= x <= high + rounding and low <= middle <= high
                    asked += 1
                    if high - low < Fraction(1, 100):  # else: at a cut-off, or the share of a sliver
                        widest = max(widest, high - low)
    assert asked > 200
    assert widest < (1e-3 if shift else 1e-6)


def test_nothing_is_in_doubt_where_the_place_does_not_matter():
    scene = one(Material((0.3, 0.6, 0.9, 0.7), "BLEND", transmission=0.4, texture=texture((10, 200, 90, 255))))
    samples = ViewSamples.points([(0.3, -1, 0.3), (2, -1, 2)])
    mask, lowest, highest = Oracle().prepare(scene).decide(Light.directional((0, -1, 0)), samples)
    np.testing.assert_array_equal(lowest, highest)
    exact = lets_through(scene.materials[0], factors(scene.materials[0].texture[0, 0], None))
    np.testing.assert_allclose(mask.transmittance, [[float(x) for x in exact], [1, 1, 1]], rtol=2.0**-24)


@pytest.mark.parametrize(("cutoff", "lowest", "highest"), [(0.5, 0, 1), (0.5 - 1e-9, 0, 0), (0.5 + 1e-9, 1, 1)])
def test_at_a_cut_off_it_is_there_or_not(cutoff, lowest, highest):
    # Alpha grows from 0 to 1 between the texels' centres, u = 1/4 and 3/4; it is 1/2 at x = 1/2.
    half = Material(WHITE, "MASK", cutoff, texture=texture((0, 0, 0, 0), (0, 0, 0, 255)))
    samples = ViewSamples.points([(0.5, -1, 0.25), (0.25, -1, 0.25), (0.75, -1, 0.125)])
    found = Oracle().prepare(one(half, uv=UV)).decide(Light.directional((0, -1, 0)), samples)
    assert found.lowest[:, 0].tolist() == [lowest, 1, 0] and found.highest[:, 0].tolist() == [highest, 1, 0]


# Whole masks


def test_a_mask_holds_shares_of_light_only_where_casters_let_some_through():
    samples = ViewSamples.points([(0.25, -1, 0.25), (2, -1, 2)])
    light = Light.directional((0, -1, 0))
    solid, pane = one(Material()), one(Material((1, 1, 1, 0.75), "BLEND"))
    found = Oracle().prepare(solid).decide(light, samples)
    assert found.mask.partial is None and found.lowest is None and found.highest is None
    mask = Oracle().prepare(pane).shadow(light, samples)
    assert mask.partial.tolist() == [[0.25] * 3, [1.0] * 3] and mask.tolerance == 0
    assert mask.in_shadow.tolist() == [False, False] and mask.guarantee == "exact"
    assert mask.partial.dtype == np.float32
    # Background is lit, and the shape is that of the samples.
    samples = ViewSamples.points([[(0.25, -1, 0.25)], [(0.25, -1, 0.25)]])
    samples.covered[1] = False
    assert Oracle().prepare(pane).shadow(light, samples).transmittance[:, 0, 0].tolist() == [0.25, 1.0]


def test_many_panes_above_many_samples():
    # More pairs than are held at a time; 40 panes and a sample below each of them.
    heights = np.arange(1, 41, dtype=np.float32)
    square = np.array([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], np.float32)
    positions = (square + heights[:, None, None] * np.float32([0, 1, 0])).reshape(-1, 3)
    triangles = (4 * np.arange(40)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    scene = Scene(positions, triangles, Material((1, 1, 1, 0.25), "BLEND"))
    rng = np.random.default_rng(6)
    points = np.round(rng.uniform(-1, 1, (3000, 3)) * 8) / 8.5
    level = rng.integers(0, 41, 3000)
    points[:, 1] = 40.5 - level
    mask = Oracle().prepare(scene).shadow(Light.directional((0, -1, 0)), ViewSamples.points(points))
    np.testing.assert_allclose(mask.transmittance, np.repeat(0.75 ** level[:, None], 3, axis=1), rtol=1e-6)
    assert mask.stats["predicate_fallbacks"] > 1000, "a diagonal without a sample below it tests nothing"


def test_margins_where_light_is_let_through():
    # A solid of side 4 at height 2, a pane of side 2 below it and one beside it.
    square = np.array([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], np.float32)
    places = [(2 * square, (0, 2, 0)), (square, (0, 1, 0)), (square, (8, 1, 0))]
    positions = np.concatenate([shape + np.float32(place) for shape, place in places])
    triangles = (4 * np.arange(3)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    pane = Material((1, 1, 1, 0.5), "BLEND")
    scene = Scene(positions, triangles, [Material(), pane], [0, 0, 1, 1, 1, 1])
    light, caster = Light.directional((0, -1, 0)), Oracle().prepare(scene)
    points = ViewSamples.points([(0.99, 0, 0.5), (1.98, 0, 0.5), (8.98, 0, 0.5), (9.03, 0, 0.5), (20, 0, 0)])
    mask = caster.shadow(light, points)
    assert mask.transmittance[:, 0].tolist() == [0, 0, 0.5, 1, 1]
    cap = np.linalg.norm(scene.bounds[1] - scene.bounds[0]) / 100
    # Deep below the solid the pane's side does not matter; below a pane it is the nearest side that does.
    np.testing.assert_allclose(caster.margin(light, points, mask.in_shadow), [cap, 0.02, 0.02, 0.03, cap], rtol=1e-4)


# The predicate, where the own triangle has copies


@pytest.mark.parametrize("closed", [True, False])
def test_copies_of_the_own_triangle_shade_its_back_and_not_its_front(closed):
    positions = np.array([(0, 0, 0), (4, 0, 0), (0, 0, 4)], np.float32)
    scene = Scene(positions, [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
    light = Light.point((1, 3, 1))
    exact, source, point = Exact(scene, light), light.position.astype(np.float64), np.empty(3)
    uv = [(0.25, 0.25), (0, 0), (0.5, 0.5), (0, 0.25), (1, 0)]
    for side in (-1, 0, 1):
        samples = ViewSamples.on_surface(scene, [0] * len(uv), uv, side)
        for index, (u, v) in enumerate(uv):
            for t in (1, 2):
                facing = predicates.facing(scene.positions, scene.triangles, t, source)
                flags = predicates.shadows(
                    scene.positions, scene.triangles, t, facing, source, 0, u, v, side, point, closed
                )
                right = exact.shades(samples, index, t, closed)
                assert bool(flags & predicates.SHADOWED) == right, (side, index, t)
                # The light is above, the triangle's front below.
                assert not right or side == 1
                if index == 0:
                    assert right == (side == 1)
