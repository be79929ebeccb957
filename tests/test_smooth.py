"""Smooth shadow boundaries: closed whatever the mesh, near to the smooth surface's shadow, and the same on the GPU."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapes import GROUND, Shape, above_ground, cone, cylinder, lump, revolve, sphere, torus, turned
from umbrae import (
    METHODS,
    Camera,
    Guarantee,
    InputError,
    Light,
    OptionError,
    Scene,
    ViewSamples,
    sample,
    shadow,
    verify,
)
from umbrae.geometry.hermite import Curves, curved
from umbrae.geometry.smooth_mesh import smooth_mesh
from umbrae.geometry.smooth_surface import SmoothSurface, bands, core, smooth_surface
from umbrae.methods.oracle import Exact
from umbrae.methods.smooth.cancelling import parts_cancel
from umbrae.methods.smooth.cpu import Smooth
from umbrae.methods.smooth.gl import SmoothGl

CAMERA = Camera.look_at((4, 6, 8), (-1, 0.2, -0.5), fov_y=45, width=480, height=360)
LIGHTS = {
    "point": Light.point((2.5, 5, 1.5)),
    "sun": Light.directional((-0.5, -1, -0.35)),
    "amid": Light.point((1.2, 1.0, 1.6)),
}
SHAPES = {
    "sphere": (sphere(20), sphere(720)),
    "torus": (torus(24, 16), torus(720, 360)),
    "cylinder": (cylinder(20), cylinder(1440)),
    "cone": (cone(20), cone(1440)),
}


def surface_of(scene: Scene, light: Light, epsilon: float | None = 1e-2) -> SmoothSurface:
    mesh = smooth_mesh(scene.positions, scene.triangles, scene.normals)
    tolerance = None if epsilon is None else lambda curves: np.full(len(curves.p0), epsilon)
    return smooth_surface(mesh, light.position, tolerance)


def net_directed_edges(scene: Scene, surface: SmoothSurface) -> np.ndarray:
    """How often each directed edge of the whole volume is run, less how often the opposite one is: caps, bands, sides.

    Vertices of the volume are those of the surface, by exact position, and each once more at infinity.
    """
    closing = bands(surface)
    positions = np.concatenate([surface.positions, closing.points]) + np.float32(0)
    _, place = np.unique(positions, axis=0, return_inverse=True)
    # Vertices with numbers of their own, breakpoints above all, must close by number, not by position.
    numbers = np.arange(len(positions))
    numbers[: len(scene.positions)] = -1 - place[: len(scene.positions)]
    _, vertex = np.unique(numbers, return_inverse=True)
    far = int(vertex.max()) + 1
    light_caps = vertex[np.concatenate([surface.triangles, closing.triangles])]
    times = np.concatenate([surface.chain, surface.bounds.times[closing.part]])
    bounds, first = surface.bounds, len(surface.positions)
    starts, stops, counts = [], [], []
    for part, chords in enumerate(surface.chords):
        inner = np.arange(first, first + chords - 1)
        first += int(chords) - 1
        line = vertex[np.concatenate([[bounds.ends[part, 0]], inner, [bounds.ends[part, 1]]])]
        starts.append(line[:-1])
        stops.append(line[1:])
        counts.append(np.full(chords, bounds.times[part]))
    a, b, m = (np.concatenate(rows) if rows else np.zeros(0, int) for rows in (starts, stops, counts))
    # A side runs back along the contour, away to infinity, and along it there.
    sides = [(b, a), (a, a + far), (a + far, b + far), (b + far, b)]
    edges = [(light_caps[:, i], light_caps[:, (i + 1) % 3], times) for i in range(3)]
    edges += [(light_caps[:, (i + 1) % 3] + far, light_caps[:, i] + far, times) for i in range(3)]
    edges += [(p, q, m) for p, q in sides]
    net = np.zeros((2 * far, 2 * far), np.int64)
    for p, q, count in edges:
        np.add.at(net, (p, q), count)
        np.add.at(net, (q, p), -count)
    return net


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("name", SHAPES)
def test_volumes_are_closed(name, kind):
    scene = above_ground(turned(SHAPES[name][0]))
    for epsilon in (1e-3, None):
        surface = surface_of(scene, LIGHTS[kind], epsilon)
        assert (surface.chords > 1).any() == (epsilon is not None)
        assert not net_directed_edges(scene, surface).any()


@st.composite
def soups(draw: st.DrawFn) -> Scene:
    """A few triangles on a small grid, with any normals or none: they share edges, fold over, and coincide."""
    count = draw(st.integers(3, 7))
    whole = st.integers(-2, 2)
    positions = draw(st.lists(st.tuples(whole, whole, whole), min_size=count, max_size=count))
    corner = st.integers(0, count - 1)
    triangles = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=10))
    normals = draw(st.lists(st.tuples(whole, whole, whole), min_size=count, max_size=count))
    return Scene(np.array(positions, float), np.array(triangles), normals=np.array(normals, float))


lights = st.builds(
    lambda place, w: Light.point(place) if w or not any(place) else Light.directional(place),
    st.tuples(*[st.integers(-9, 9).map(lambda i: i / 2)] * 3),
    st.booleans(),
)


@settings(max_examples=300)
@given(soups(), lights, st.sampled_from([1e-2, 0.3, None]))
def test_volumes_are_closed_on_any_soup(scene, light, epsilon):
    assert not net_directed_edges(scene, surface_of(scene, light, epsilon)).any()


@settings(max_examples=60)
@given(soups(), lights, st.integers(0, 1000))
def test_counts_are_those_of_rational_numbers(scene, light, seed):
    points = ViewSamples.points(np.random.default_rng(seed).uniform(-3, 3, (20, 3)))
    mask = shadow(scene, light, points, Smooth(epsilon=0.3))
    surface = surface_of(scene, light, 0.3)
    closing = bands(surface)
    soup = Scene(
        np.concatenate([surface.positions, closing.points]), np.concatenate([surface.triangles, closing.triangles])
    )
    chain = np.concatenate([surface.chain, surface.bounds.times[closing.part]])
    mesh = smooth_mesh(scene.positions, scene.triangles, scene.normals)
    corners = np.concatenate([mesh.welded[mesh.triangles[surface.source]], surface.bounds.corners[closing.part]])
    shades = core(mesh, surface)
    exact = Exact(soup, light)
    weight = [int(times) * facing_by_fractions(soup, t, light) for t, times in enumerate(chain)]
    for index in range(points.size):
        crossed = [t for t, w in enumerate(weight) if w and exact.shades(points, index, t, False)]
        alone = any(exact.shades(points, index, t) for t in np.flatnonzero(shades))
        assert mask.in_shadow[index] == (alone or not connected_parts_cancel(crossed, weight, corners))


def connected_parts_cancel(crossed: list[int], weight: list[int], corners: np.ndarray) -> bool:
    left = set(crossed)
    while left:
        part = {left.pop()}
        while near := {t for t in left if any(set(corners[t]) & set(corners[other]) for other in part)}:
            part |= near
            left -= near
        if sum(weight[t] for t in part) != 0:
            return False
    return True


def facing_by_fractions(scene: Scene, t: int, light: Light) -> int:
    a, b, c = ([Fraction(float(x)) for x in scene.positions[v]] for v in scene.triangles[t])
    u, v = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c))
    normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    *place, w = (Fraction(float(x)) for x in light.position)
    value = sum(n * (p - w * q) for n, p, q in zip(normal, place, a, strict=True))
    return (value > 0) - (value < 0)


def on_ground(samples: ViewSamples) -> np.ndarray:
    return samples.covered & (samples.triangle < GROUND)


@pytest.mark.parametrize("kind", ["point", "sun"])
@pytest.mark.parametrize("name", SHAPES)
def test_smooth_is_four_times_nearer_to_the_fine_mesh(name, kind):
    for pose in (lambda shape: shape, turned):
        coarse, fine = (above_ground(pose(shape)) for shape in SHAPES[name])
        samples = sample(coarse, CAMERA)
        ground = on_ground(samples)
        there = dataclasses.replace(samples, covered=ground, triangle=np.where(ground, samples.triangle, -1))
        truth = shadow(fine, LIGHTS[kind], there).in_shadow
        wrong = {}
        for silhouette in ("discrete", "smooth"):
            mask = shadow(coarse, LIGHTS[kind], samples, Smooth(silhouette=silhouette))
            wrong[silhouette] = int((mask.in_shadow != truth)[ground].sum())
        assert wrong["discrete"] >= 4 * max(wrong["smooth"], 1), wrong


def test_a_sphere_is_lit_up_to_its_smooth_terminator():
    scene, light = above_ground(sphere(20)), LIGHTS["point"]
    samples = sample(scene, CAMERA)
    ball = samples.covered & (samples.triangle >= GROUND)
    a, b, c = (scene.normals[scene.triangles[samples.triangle, k]].astype(float) for k in range(3))
    p, q, r = (scene.positions[scene.triangles[samples.triangle, k]].astype(float) for k in range(3))
    u, v = samples.barycentric[..., :1].astype(float), samples.barycentric[..., 1:].astype(float)
    to_light = light.position[:3].astype(float)
    f = [(n * (to_light - x)).sum(axis=-1, keepdims=True) for n, x in ((a, p), (b, q), (c, r))]
    lit = (f[0] + u * (f[1] - f[0]) + v * (f[2] - f[0]))[..., 0]
    sure = ball & (np.abs(lit) > 1e-5)
    mask = shadow(scene, light, samples, Smooth())
    # No leak on the unlit side, no inverted shadow on the lit one.
    np.testing.assert_array_equal(mask.in_shadow[sure], lit[sure] < 0)
    normal = samples.position - [0, 1.6, 0]
    truth = (normal * (to_light - samples.position)).sum(axis=-1) < 0
    wrong = [
        int((shadow(scene, light, samples, Smooth(silhouette=kind)).in_shadow != truth)[ball].sum())
        for kind in ("discrete", "accurate", "smooth")
    ]
    assert wrong[0] > 4 * wrong[2]
    assert wrong[0] > 4 * wrong[1]


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_unlit_by_the_smooth_normals_is_lit(name):
    scene = above_ground(turned(SHAPES[name][0]))
    for light in LIGHTS.values():
        caster = Smooth().prepare(scene)
        samples = sample(scene, CAMERA)
        away = caster.silhouettes.turned_away(caster.silhouettes.surface(light, samples), samples)
        mask = caster.shadow(light, samples)
        assert mask.in_shadow.reshape(-1)[away].all()
        assert away.any()


def deep(dark: np.ndarray, ground: np.ndarray, pixels: int = 4) -> np.ndarray:
    """Dark ground that far from lit ground."""
    lit = ~dark & ground
    for _ in range(pixels):
        lit = lit | near_boundary(lit)
    return dark & ground & ~lit


@pytest.mark.usefixtures("opengl")
def test_contours_that_fold_over_other_parts_let_no_light_through():
    scene = above_ground(lump(14, 11), 2.2).smoothed(90)
    samples = sample(scene, CAMERA)
    ground, light = on_ground(samples), LIGHTS["point"]
    core = deep(shadow(scene, light, samples).in_shadow, ground)
    assert core.sum() > 1000
    for method in ("smooth", "smooth-gl"):
        assert not (core & ~shadow(scene, light, samples, method).in_shadow).any(), method


def test_only_what_is_connected_cancels():
    corners = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6], [7, 8, 9]], np.int32)

    def cancel(crossed: list[int], times: list[int]) -> bool:
        return bool(parts_cancel(np.array(crossed, np.int64), np.array(times, np.int64), len(crossed), corners))

    assert cancel([0, 1], [1, -1])
    assert not cancel([0, 3], [1, -1])
    assert cancel([0, 2, 1], [1, 1, -2])  # the first two through the third
    assert not cancel([0, 2, 3], [1, 1, -2])
    assert cancel([3, 0, 3, 1], [2, 1, -2, -1])
    assert cancel([], [])


@pytest.mark.parametrize("kind", LIGHTS)
def test_discrete_is_the_frustum_method(kind):
    scene = above_ground(turned(SHAPES["torus"][0]))
    samples = sample(scene, CAMERA)
    discrete = shadow(scene, LIGHTS[kind], samples, Smooth(silhouette="discrete"))
    np.testing.assert_array_equal(discrete.in_shadow, shadow(scene, LIGHTS[kind], samples).in_shadow)
    flat = Scene(scene.positions, scene.triangles)
    np.testing.assert_array_equal(discrete.in_shadow, shadow(flat, LIGHTS[kind], samples, Smooth()).in_shadow)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("silhouette", ["smooth", "accurate", "discrete"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_gpu_counts_the_same(name, silhouette):
    scene = above_ground(turned(SHAPES[name][0]))
    samples = sample(scene, CAMERA)
    for kind, light in LIGHTS.items():
        caster = SmoothGl(silhouette=silhouette).prepare(scene)
        found = caster.shadow(light, samples).in_shadow
        right = shadow(scene, light, samples, Smooth(silhouette=silhouette)).in_shadow
        differ = found != right
        assert differ.sum() <= 2, kind
        assert not differ[~near_boundary(right)].any(), kind
        # Closed: the eye is in no volume.
        assert not caster.volumes(light, samples).net_count(light, samples).any(), kind


def near_boundary(in_shadow: np.ndarray) -> np.ndarray:
    """Pixels that have a neighbour with another verdict."""
    near = np.zeros_like(in_shadow)
    for axis in (0, 1):
        change = np.diff(in_shadow, axis=axis)
        pads = [(0, 0), (0, 0)]
        for pads[axis] in ((0, 1), (1, 0)):
            near |= np.pad(change, pads)
    return near


@pytest.mark.usefixtures("opengl")
def test_the_gpu_counts_samples_of_a_pixel():
    scene, light = above_ground(SHAPES["sphere"][0]), LIGHTS["point"]
    samples = sample(scene, Camera.look_at((4, 6, 8), (-1, 0.2, -0.5), fov_y=45, width=160, height=120), 3)
    found, right = (shadow(scene, light, samples, method).in_shadow for method in ("smooth-gl", "smooth"))
    assert (found != right).sum() <= 2


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.floats(1e-4, 0.5))
def test_chords_keep_to_epsilon(seed, epsilon):
    rng = np.random.default_rng(seed)
    curves = Curves(*rng.normal(size=(4, 1, 3)))
    pieces = int(curves.chords(np.array([epsilon]))[0])
    ends = Curves(*(np.repeat(part, pieces + 1, axis=0) for part in curves)).at(np.linspace(0, 1, pieces + 1))
    worst = 0.0
    for i in range(pieces):
        u = (i + np.linspace(0, 1, 17)) / pieces
        arc = Curves(*(np.repeat(part, 17, axis=0) for part in curves)).at(u)
        chord = ends[i] + np.linspace(0, 1, 17)[:, None] * (ends[i + 1] - ends[i])
        worst = max(worst, float(np.linalg.norm(arc - chord, axis=1).max()))
    assert worst <= epsilon or pieces == 64
    if pieces > 1:
        assert worst > epsilon / 20, "not far finer than asked for"
    np.testing.assert_array_equal(ends[[0, -1]], np.concatenate([curves.p0, curves.p1]))


def test_a_quarter_circle_is_nearly_met():
    first, last = np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]])
    curves = curved(first, last, last, -first)
    u = np.linspace(0, 1, 101)
    points = Curves(*(np.repeat(part, 101, axis=0) for part in curves)).at(u)
    # The arc's length is given, not its middle: 1.5 % off, and a sixteenth of that for half the angle.
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 0.016


def test_halves_of_a_curve_are_the_curve():
    curves = Curves(*np.random.default_rng(4).normal(size=(4, 3, 3)))
    half = curves.between(np.full(3, 0.25), np.full(3, 0.75))
    for u in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(half.at(np.full(3, u)), curves.at(np.full(3, 0.25 + u / 2)), atol=1e-12)


@pytest.mark.parametrize("kind", ["point", "sun"])
def test_chords_keep_to_a_quarter_of_a_pixel(kind):
    """Where a verdict differs from that of the finest chords, the boundary passes through the pixel."""
    for name in ("torus", "cylinder"):
        scene = above_ground(turned(SHAPES[name][0]))
        samples = sample(scene, CAMERA)
        ground = on_ground(samples)
        finest = shadow(scene, LIGHTS[kind], samples, Smooth(epsilon=1e-9))
        asked = shadow(scene, LIGHTS[kind], samples, Smooth())
        rough = shadow(scene, LIGHTS[kind], samples, Smooth(epsilon_px=4.0))
        assert finest.stats["contour_edges"] > asked.stats["contour_edges"] > rough.stats["contour_edges"]
        off = (asked.in_shadow != finest.in_shadow) & ground
        assert not off[~near_boundary(finest.in_shadow)].any()
        # An eighth of a pixel on average along the boundary, were it a quarter off everywhere.
        assert off.sum() < 0.25 * (near_boundary(finest.in_shadow) & ground).sum() / 2


def test_levels_of_detail_do_not_pop():
    """A falling light over three levels of detail of one sphere, as far as the shadows on the ground go."""
    scenes = [above_ground(sphere(segments)) for segments in (14, 28, 56)]
    samples = sample(scenes[0], CAMERA)
    ground = on_ground(samples)
    for other in scenes[1:]:
        ground &= on_ground(sample(other, CAMERA))
    there = dataclasses.replace(samples, covered=ground, triangle=np.where(ground, samples.triangle, -1))
    for angle in np.linspace(0.35, 1.4, 6):
        light = Light.directional((-np.cos(angle), -np.sin(angle), -0.2))
        masks = {
            kind: [shadow(scene, light, there, Smooth(silhouette=kind)).in_shadow for scene in scenes]
            for kind in ("discrete", "smooth")
        }
        pops = {kind: int((found[0] != found[2]).sum()) for kind, found in masks.items()}
        assert pops["smooth"] * 8 < pops["discrete"]
        assert (masks["smooth"][1] != masks["smooth"][2]).sum() <= 20


def open_shapes() -> dict[str, Shape]:
    """A bowl and a bent sheet: smooth, and open."""
    angles = [0.25 * np.pi * i / 3 for i in range(4)]
    bowl = revolve([(np.sin(a), -np.cos(a), np.sin(a), -np.cos(a)) for a in angles if a > 0], 12)
    return {"bowl": bowl, "bowl inside out": Shape(bowl.positions, bowl.triangles[:, ::-1], -bowl.normals)}


@pytest.mark.parametrize("name", open_shapes())
def test_open_meshes_cast_from_both_sides(name):
    scene = above_ground(open_shapes()[name])
    samples = sample(scene, CAMERA)
    ground = on_ground(samples)
    for light in (LIGHTS["point"], Light.point((0.1, 1.2, 0.05))):
        found = shadow(scene, light, samples, Smooth()).in_shadow
        near = shadow(scene, light, samples).in_shadow
        assert near[ground].any()
        # The rims differ, the shadows do not.
        assert (found != near)[ground].sum() < 0.2 * near[ground].sum()
        assert not net_directed_edges(scene, surface_of(scene, light)).any()


def test_a_light_in_a_ball_leaves_everything_outside_dark():
    scene = above_ground(sphere(12))
    samples = sample(scene, CAMERA)
    for light in (Light.point((0, 1.6, 0)), Light.point((0.3, 1.9, -0.5))):
        mask = shadow(scene, light, samples, Smooth())
        assert mask.in_shadow[samples.covered].all()


def flat_faced() -> dict[str, Scene]:
    """Two parallel triangles, and a cube on a floor, with normals that are the facets' own."""
    pair = Scene([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], [(0, 1, 2), (3, 4, 5)])
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    floor = [(-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3)]
    cube = Scene(np.concatenate([corners, floor]), [*triangles, (8, 9, 10), (8, 10, 11)])
    return {"pair": pair.smoothed(40), "cube": cube.smoothed(40)}


@pytest.mark.parametrize("method", ["smooth", "smooth-gl"])
@pytest.mark.parametrize("name", ["pair", "cube"])
def test_facets_with_their_own_normals_are_flat_under_any_light(name, method):
    scene = flat_faced()[name]
    samples = sample(scene, Camera.frame(scene, width=64, height=48))
    places = [(3, 3, 0), (0, 0, 0), (0.5, 0, 0), (1, 1, 1), (0.25, 0.25, 0), (2, 1, 0.5), (5, 7, 3)]
    for light in (*map(Light.point, places), Light.sun(0, 0), Light.sun(90, 0), Light.sun(30, 90), Light.sun(215, 40)):
        mask = shadow(scene, light, samples, method)
        assert mask.guarantee != Guarantee.NONE
        assert verify(scene, light, samples, mask).ok, light


def test_a_light_anywhere_is_taken():
    scene = above_ground(turned(SHAPES["cylinder"][0]))
    samples = sample(scene, Camera.look_at((4, 6, 8), (-1, 0.2, -0.5), width=64, height=48))
    corners = scene.positions[scene.triangles[-1]].astype(float)
    for place in (corners[0], corners.mean(axis=0), corners[0] + 2 * (corners[1] - corners[0]), (0, 0, 0)):
        assert shadow(scene, Light.point(place), samples, Smooth()).in_shadow.shape == samples.shape


def test_silhouettes_are_kept_while_nothing_changes():
    scene = above_ground(SHAPES["sphere"][0])
    samples = sample(scene, CAMERA)
    caster = Smooth().prepare(scene)
    first = caster.silhouettes.surface(LIGHTS["point"], samples)
    assert caster.silhouettes.surface(LIGHTS["point"], samples) is first
    assert caster.silhouettes.surface(LIGHTS["sun"], samples) is not first
    again = caster.silhouettes.surface(LIGHTS["point"], samples)
    assert again is not first
    other = sample(scene, dataclasses.replace(CAMERA, fov_y=20.0))
    assert caster.silhouettes.surface(LIGHTS["point"], other) is not again, "another picture has other pixels"
    in_world = Smooth(epsilon=0.01).prepare(scene).silhouettes
    assert in_world.surface(LIGHTS["point"], samples) is in_world.surface(LIGHTS["point"], other)


def test_an_area_light_is_soft_and_smooth():
    scene = above_ground(SHAPES["sphere"][0])
    samples = sample(scene, dataclasses.replace(CAMERA, width=120, height=90))
    mask = shadow(scene, Light.point((2.5, 5, 1.5), radius=0.5), samples, Smooth(light_samples=8))
    shares = np.unique(mask.transmittance[on_ground(samples)])
    assert len(shares) > 4
    assert shares.min() == 0 and shares.max() == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"silhouette": "round"}, "smooth: silhouette: wanted one of smooth, accurate, discrete"),
        ({"epsilon": 0.0}, "smooth: epsilon: wanted a positive number, got 0.0"),
        ({"epsilon_px": float("nan")}, "smooth: epsilon_px: wanted"),
        ({"epsilon": "thin"}, "smooth: epsilon: wanted"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises((OptionError, InputError), match=message.replace("(", r"\(")):
        Smooth(**options)


def test_methods_are_known():
    assert METHODS["smooth"] is Smooth
    assert METHODS["smooth-gl"] is SmoothGl


def test_normals_are_made_for_models_without():
    shape = turned(SHAPES["cylinder"][0])
    flat = Scene(shape.positions, shape.triangles)
    smoothed = flat.smoothed(45)
    assert smoothed.normals is not None
    # The side's normals point away from the axis, the ends' along it, and rims have both.
    facets = np.cross(*(np.diff(smoothed.positions[smoothed.triangles].astype(float), axis=1).transpose(1, 0, 2)))
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    along = np.einsum("tkj,tj->tk", smoothed.normals[smoothed.triangles].astype(float), facets)
    assert along.min() > np.cos(np.radians(10))
    assert len(smoothed.positions) == 120, "rims twice, and the ends' middles, of which there are 20 in the mesh"
    one = flat.smoothed(180)
    assert len(np.unique(one.normals.round(5), axis=0)) == 20 * 2 + 2, "no creases"
    np.testing.assert_array_equal(
        flat.smoothed(0).positions[flat.smoothed(0).triangles], flat.positions[flat.triangles]
    )
    for angle in (-1, 181, float("nan")):
        with pytest.raises(InputError, match="crease"):
            flat.smoothed(angle)
