"""Lights with a size: where their samples lie, and every bit of the frustum method against the definition."""

import dataclasses

import numpy as np
import pytest

from truth import lattice_soup, random_samples, random_soup
from umbrae import (
    Camera,
    Guarantee,
    InputError,
    Light,
    OptionError,
    Scene,
    ShadowMask,
    ViewSamples,
    arguments,
    sample,
    shadow,
)
from umbrae.clock import Clock
from umbrae.methods import area_frustum, cast_shadow, make_method
from umbrae.methods.area_average import average_over_light
from umbrae.methods.area_frustum import find
from umbrae.methods.area_samples import fill_lights, fixed_samples, light_disc, light_samples
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.oracle import Exact, Oracle
from umbrae.models import sphere, spheres
from umbrae.parallel import kernel

LAMP = Light.point((0.3, 2.5, 0.2), radius=0.4)
SUN = Light.directional((-0.3, -1.0, -0.2), angular_diameter=9.0)


# ---- where light samples lie ----


@kernel
def fill_all(disc, position, lights):
    for index in range(len(position)):
        fill_lights(disc, index, position[index, 0], position[index, 1], position[index, 2], lights[index], 0)


@pytest.mark.parametrize("shape", [(500,), (20, 25), (10, 10, 5), (2, 5, 5, 10)])
@pytest.mark.parametrize(
    "light",
    [LAMP, SUN, Light.point((0, 0, 0), radius=3), Light.directional((1e-9, 0, 3e12), angular_diameter=170)],
)
def test_kernels_and_numpy_see_the_same_light_samples_to_the_last_bit(shape, light):
    rng = np.random.default_rng(1)
    points = rng.uniform(-3, 3, (500, 3))
    points[:4] = light.position[:3] * [[1], [1], [-1], [1e-30]]  # at the light itself, too
    points[4] = light.position[:3] - [0, 0, 5]
    samples = ViewSamples.points(points.reshape(*shape, 3))
    wanted = light_samples(light, samples, 37)
    assert wanted.shape == (500, 37, 4)
    assert wanted.dtype == np.float32
    found = np.zeros((500, 3, 37), np.float32)
    fill_all(light_disc(light, 37, shape), samples.position.reshape(-1, 3), found)
    np.testing.assert_array_equal(np.moveaxis(found, 1, 2), wanted[..., :3])
    assert (wanted[..., 3] == light.position[3]).all()
    some = np.array([3, 77, 401])
    np.testing.assert_array_equal(light_samples(light, samples, 37, some), wanted[some])


def test_samples_of_a_sphere_fill_the_disc_that_faces_the_view_sample():
    points = np.random.default_rng(2).uniform(-3, 3, (400, 3))
    lights = light_samples(LAMP, ViewSamples.points(points), 32)[..., :3].astype(np.float64)
    middle = LAMP.position[:3].astype(np.float64)
    offset, axis = lights - middle, middle - points.astype(np.float32)
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    np.testing.assert_allclose((offset * axis[:, None]).sum(axis=2), 0, atol=1e-6)
    # One in each of 32 rings of equal area.
    share = (np.linalg.norm(offset, axis=2) / LAMP.radius) ** 2 * 32
    np.testing.assert_array_equal(
        np.floor(share + 1e-4 * (np.arange(32) - share + 0.5)), np.tile(np.arange(32), (400, 1))
    )
    assert np.linalg.norm(offset, axis=2).max() <= light_disc(LAMP, 32, (400,)).reach
    # Balanced about the middle for each view sample, and over all of them without any pattern.
    assert np.linalg.norm(offset.mean(axis=1), axis=1).max() < 0.12 * LAMP.radius
    assert np.abs(offset.mean(axis=(0, 1))).max() < 0.005 * LAMP.radius


@pytest.mark.parametrize("diameter", [0.53, 20.0, 170.0])
def test_samples_of_a_sun_fill_its_patch_of_sky_evenly(diameter):
    sun = dataclasses.replace(SUN, angular_diameter=diameter)
    samples = ViewSamples.points(np.zeros((40, 50, 3)))
    lights = light_samples(sun, samples, 16)[..., :3].astype(np.float64)
    axis = sun.position[:3] / np.linalg.norm(sun.position[:3].astype(np.float64))
    cos = (lights @ axis) / np.linalg.norm(lights, axis=2)
    edge = np.cos(np.radians(diameter / 2))
    assert cos.min() >= edge - 1e-6
    # Area on the sphere is height along the axis: the same share in each sixteenth of it.
    height = np.clip((1 - cos) / (1 - edge), 0, 1)
    np.testing.assert_allclose(height.mean(axis=0), (np.arange(16) + 0.5) / 16, atol=2e-3)
    disc = light_disc(sun, 16, (40, 50))
    assert np.linalg.norm(lights - disc.source[:3], axis=2).max() <= disc.reach


def test_neighbours_see_other_places_of_the_light():
    samples = ViewSamples.points(np.zeros((32, 32, 3)))
    first = light_samples(SUN, samples, 8)[:, 0, :3].astype(np.float64).reshape(32, 32, 3)
    scale = light_disc(SUN, 8, (32, 32)).reach / np.sqrt(8)
    for axis in (0, 1):
        assert np.linalg.norm(np.diff(first, axis=axis), axis=2).mean() > 0.4 * scale
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 1000


def test_a_light_that_shrinks_ends_as_its_middle():
    points = ViewSamples.points(np.random.default_rng(3).uniform(-1, 1, (50, 3)))
    for light in (Light.point((0.3, 2.5, 0.2), radius=1e-12), Light.directional((-3, -1, -2), angular_diameter=1e-9)):
        lights = light_samples(light, points, 8)
        # A direction's length does not matter: here it was doubled or halved until its largest part was at least 1.
        scale = np.abs(lights[0, 0, :3]).max() / np.abs(light.position[:3]).max()
        assert np.log2(scale) == np.round(np.log2(scale))
        np.testing.assert_array_equal(lights[..., :3], np.broadcast_to(light.position[:3] * scale, (50, 8, 3)))


def test_fixed_samples_face_one_point():
    lights = fixed_samples(LAMP, np.array([0.3, -5.0, 0.2]), 20)
    assert lights.shape == (20, 4)
    np.testing.assert_allclose(lights[:, 1], 2.5, atol=1e-6)
    assert (np.linalg.norm(lights[:, :3] - LAMP.position[:3], axis=1) <= LAMP.radius).all()
    assert fixed_samples(LAMP, np.zeros(3), 1).tolist() == [LAMP.position.tolist()]


@pytest.mark.parametrize("count", [0, 65, -3, 1.5, "many"])
def test_wrong_numbers_of_light_samples_are_refused(count):
    with pytest.raises(InputError, match=r"light_samples|light samples"):
        Frustum(light_samples=count)
    if not isinstance(count, int) or count < 1:
        with pytest.raises(InputError, match="light_samples"):
            light_samples(LAMP, ViewSamples.points([[0, 0, 0]]), count)


# ---- the frustum method, bit by bit ----


def bits_of(scene: Scene, light: Light, samples: ViewSamples, count: int, culling: bool = False) -> np.ndarray:
    """`(n, count) bool`, as the frustum method says."""
    caster = Frustum(front_face_culling=culling).prepare(scene)
    (bits, _, _), _ = find(caster.casters, light, samples, count, None, Clock())
    unused = ~np.int64(0) << np.int64(count) if count < 64 else np.int64(0)
    assert ((bits & unused) == unused).all()
    return (bits[:, None] >> np.arange(count) & 1).astype(bool)


def oracle_bits(scene: Scene, light: Light, samples: ViewSamples, count: int) -> np.ndarray:
    """The same by the oracle, one light sample at a time."""
    caster = Oracle().prepare(scene)
    lights = light_samples(light, samples, count)
    truth = np.zeros((samples.size, count), bool)
    for index in np.flatnonzero(samples.covered.reshape(-1)):
        one = samples.take(np.array([index]))
        for number in range(count):
            truth[index, number] = caster.shadow(Light(lights[index, number]), one).in_shadow[0]
    return truth


@pytest.mark.parametrize("light", [LAMP, SUN, Light.point((0.1, 0.2, 0.1), radius=0.5)])
@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
def test_every_bit_is_what_plain_rationals_say(soup, light):
    rng = np.random.default_rng(5)
    scene = soup(rng, 9)
    samples = random_samples(rng, scene, 25)
    lights = light_samples(light, samples, 7)
    truth = np.zeros((25, 7), bool)
    for index in range(25):
        for number in range(7):
            exact = Exact(scene, Light(lights[index, number]))
            truth[index, number] = any(exact.shades(samples, index, t) for t in range(9))
    np.testing.assert_array_equal(bits_of(scene, light, samples, 7), truth)
    assert 0.05 < truth.mean() < 0.95


AREA_LIGHTS = [
    LAMP,
    SUN,
    Light.point((0.3, 2.5, 0.2), radius=1e-3),
    Light.point((1, 2, 1), radius=1e-9),
    Light.point((3, -2, 1), radius=2.5),
    Light.point((0, 0, 0), radius=0.2),
    Light.point((0.1, 0.2, 0.05), radius=1e-4),
    Light.point((0.1, 0.2, 0.05), radius=50),
    Light.point((1e6, 2e6, 1e5), radius=4e5),
    Light.point((1e12, -3e12, 1e11), radius=1e10),
    Light.directional((-1, -1, -1), angular_diameter=0.53),
    Light.directional((0, 0, -1), angular_diameter=1e-5),
    Light.directional((1, -1, 1), angular_diameter=60),
    Light.directional((1, 0, 0), angular_diameter=150),
    Light.directional((1e-20, 1e-20, -1e-20), angular_diameter=2),
]


@pytest.mark.parametrize("light", AREA_LIGHTS)
@pytest.mark.parametrize(("soup", "triangles"), [(lattice_soup, 40), (random_soup, 40), (random_soup, 2500)])
def test_every_bit_agrees_with_the_oracle(soup, triangles, light):
    rng = np.random.default_rng(triangles)
    scene = soup(rng, triangles) if triangles < 1000 else soup(rng, triangles, size=0.03)
    for samples in (random_samples(rng, scene, 90), ViewSamples.points(rng.integers(-12, 13, (60, 3)) / 4)):
        np.testing.assert_array_equal(bits_of(scene, light, samples, 6), oracle_bits(scene, light, samples, 6))


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-12, 1e-7, 1e-4, 0.1])
def test_samples_at_the_middle_of_the_light_and_inside_it(gap):
    rng = np.random.default_rng(6)
    scene = random_soup(rng, 60)
    light = Light.point((0.25, 0.5, -0.125), radius=0.3)
    samples = ViewSamples.points(light.position[:3] + gap * rng.normal(size=(60, 3)))
    np.testing.assert_array_equal(bits_of(scene, light, samples, 6), oracle_bits(scene, light, samples, 6))


def plain_bits(scene: Scene, light: Light, samples: ViewSamples, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Bits of free points in plain float64, where that is sure of them, and how many pairs have any."""
    lights = light_samples(light, samples, count).astype(np.float64)
    point = samples.position.reshape(-1, 1, 3).astype(np.float64)
    toward = lights[..., :3] - light.position[3] * point
    bits, sure, pairs = np.zeros(lights.shape[:2], bool), np.ones(lights.shape[:2], bool), 0
    for corners in scene.positions[scene.triangles].astype(np.float64):
        a, b, c = (corner - point for corner in corners)
        values = [(toward * np.cross(u, v)).sum(axis=-1) for u, v in ((a, b), (b, c), (c, a))]
        volume = np.broadcast_to((a * np.cross(b, c)).sum(axis=-1), values[0].shape)
        facing = (np.cross(corners[1] - corners[0], corners[2] - corners[0]) * lights[..., :3]).sum(axis=-1)
        facing -= light.position[3] * np.dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), corners[0])
        hit = (volume * facing > 0) & np.all([value * facing >= 0 for value in values], axis=0)
        for value in (*values, volume, facing):
            sure &= np.abs(value) > 1e-9 * np.abs(value).max()
        bits |= hit
        pairs += np.count_nonzero(hit.any(axis=1))
    return bits, sure, pairs


@pytest.mark.parametrize(
    "light",
    [
        Light.point((0.2, 6, -0.3), radius=0.5),
        Light.point((0.2, 6, -0.3), radius=2.0),
        Light.point((7, 5, 2), radius=1.0),
        Light.directional((0.1, -1, 0.2), angular_diameter=10),
        Light.directional((1, -1, 0.9), angular_diameter=30),
    ],
)
@pytest.mark.parametrize("turned", [0.0, 0.3, 1.2])
def test_a_region_of_influence_holds_all_of_a_penumbra_and_little_else(turned, light):
    # One small triangle; many samples below it, most of them near the edge of its penumbra.
    rng = np.random.default_rng(7)
    turn = np.array([[np.cos(turned), -np.sin(turned), 0], [np.sin(turned), np.cos(turned), 0], [0, 0, 1]])
    corners = np.array([(0.3, 0, 0.1), (-0.2, 0, 0.4), (-0.1, 0, -0.3)]) @ turn.T + (0, 2, 0)
    scene = Scene(corners.astype(np.float32), np.array([[0, 1, 2]]))
    toward = light.position[:3] - light.position[3] * np.array([0, 2, 0])
    below = np.array([0, 2, 0]) - toward * (rng.uniform(0, 2.0, (30_000, 1)) / toward[1])
    points = below + rng.uniform(-1.5, 1.5, (30_000, 3)) * (1, 0, 1)
    samples = ViewSamples.points(points)
    caster = Frustum().prepare(scene)
    (packed, _, _), stats = find(caster.casters, light, samples, 64, None, Clock())
    truth, sure, pairs = plain_bits(scene, light, samples, 64)
    np.testing.assert_array_equal((packed[:, None] >> np.arange(64) & 1).astype(bool)[sure], truth[sure])
    assert sure.mean() > 0.99
    assert pairs > 500
    if light.radius <= 0.5 and light.angular_diameter <= 10:
        # What is asked besides: near the corners, and where the triangle is not as high as its highest place. Wide
        # lights cast oblong penumbras, and their bounds are round.
        assert stats[0] < 2.5 * pairs


def test_a_tiny_light_on_a_vertex_sees_both_sides_of_the_triangle():
    corners = np.array(
        [[-2.2238462, -4.3910189, 0.45043805], [1.5427157, -2.1029248, 1.3590713], [3.4228506, -1.6096088, -1.1487389]],
        np.float32,
    )
    scene, light = Scene(corners, [(0, 1, 2)]), Light.point(corners[1], radius=1e-6)
    samples = ViewSamples.points([[-2, -2, 0], [1, -3, -1]])
    truth = oracle_bits(scene, light, samples, 64)
    np.testing.assert_array_equal(bits_of(scene, light, samples, 64), truth)
    assert 0 < truth[0].sum() < 64


def finely_tessellated() -> tuple[Scene, ViewSamples]:
    """Spheres over a ground, and a small picture of them."""
    scene = spheres(grid=(3, 3), triangles=9000)
    return scene, sample(scene, Camera.frame(scene, width=64, height=36))


@pytest.mark.parametrize(
    "light",
    [
        Light.point((-2, 7, 1.5), radius=0.5),
        Light.point((-2, 7, 1.5), radius=3),
        Light.directional((-1, -2, -0.7), angular_diameter=4),
        Light.point((0, 0.5, 0), radius=0.4),
    ],
)
def test_picture_agrees_with_the_oracle(light):
    scene, samples = finely_tessellated()
    mask = shadow(scene, light, samples, method=Frustum(light_samples=64))
    assert mask.guarantee is Guarantee.EXACT
    assert mask.tolerance == 0
    assert mask.transmittance.shape == (36, 64, 3)
    assert mask.transmittance.dtype == np.float32
    assert (mask.transmittance[~samples.covered] == 1).all(), "background is lit"
    np.testing.assert_array_equal(mask.in_shadow, mask.transmittance[..., 0] == 0)
    np.testing.assert_array_equal(mask.transmittance[..., 1:], mask.transmittance[..., :2])
    found = bits_of(scene, light, samples, 64)
    np.testing.assert_array_equal(mask.transmittance[..., 0].reshape(-1), 1 - found.mean(axis=1))
    chosen = np.flatnonzero(samples.covered.reshape(-1))[::17]
    caster, lights = Oracle().prepare(scene), light_samples(light, samples, 64, chosen)
    for index, number in zip(*np.indices((len(chosen), 8)).reshape(2, -1), strict=True):
        # Eight of the 64, others for each view sample.
        at = (8 * number + index) % 64
        truth = caster.shadow(Light(lights[index, at]), samples.take(chosen[index : index + 1])).in_shadow[0]
        assert found[chosen[index], at] == truth
    penumbra = (mask.transmittance > 0) & (mask.transmittance < 1)
    assert penumbra[samples.covered].mean() > 0.01


def test_bits_do_not_depend_on_threads_blocks_culling_or_order(monkeypatch):
    scene, samples = finely_tessellated()
    light = Light.point((-2, 7, 1.5), radius=0.5)
    plain = bits_of(scene, light, samples, 32)
    np.testing.assert_array_equal(bits_of(scene, light, samples, 32, culling=True), plain)
    shuffled = np.random.default_rng(3).permutation(len(scene.triangles))
    moved = Scene(scene.positions, scene.triangles[shuffled])
    renamed = dataclasses.replace(
        samples, triangle=np.append(np.argsort(shuffled), -1).astype(np.int32)[samples.triangle]
    )
    np.testing.assert_array_equal(bits_of(moved, light, renamed, 32), plain)
    monkeypatch.setattr(area_frustum, "BLOCK", 640)
    monkeypatch.setenv("UMBRAE_THREADS", "3")
    np.testing.assert_array_equal(bits_of(scene, light, samples, 32), plain)


def test_culling_leaves_solids_around_the_light_and_beside_it_whole():
    ball = sphere((0, 0, 0), 1.0, 24, 12)
    ground = Scene(np.array([[-3, -1, -3], [3, -1, -3], [0, -1, 4]], np.float32), np.array([[0, 1, 2]]))
    both = Scene(
        np.concatenate([ball.positions, ground.positions]),
        np.concatenate([ball.triangles, ground.triangles + len(ball.positions)]),
    )
    samples = sample(both, Camera.look_at((0, 2, 5), (0.5, -0.3, -1), width=32, height=24))
    for light in (Light.point((0.1, 0.3, 0.2), radius=0.1), Light.point((1, 4, 2), radius=3), SUN):
        np.testing.assert_array_equal(bits_of(both, light, samples, 9, True), bits_of(both, light, samples, 9))


# ---- what is known without an oracle ----


@pytest.mark.parametrize("count", [1, 16, 64])
def test_a_light_without_extent_casts_the_hard_shadow(count):
    scene, samples = finely_tessellated()
    for hard, soft in (
        (Light.point((-2, 7, 1.5)), Light.point((-2, 7, 1.5), radius=1e-12)),
        (Light.directional((-1, -2, -0.7)), Light.directional((-1, -2, -0.7), angular_diameter=1e-10)),
    ):
        mask = shadow(scene, soft, samples, method=Frustum(light_samples=count))
        wanted = shadow(scene, hard, samples)
        np.testing.assert_array_equal(mask.in_shadow, wanted.in_shadow)
        np.testing.assert_array_equal(mask.transmittance, wanted.transmittance)


def covered_share(height: np.ndarray) -> np.ndarray:
    """The part of the unit disc that lies below a line at a height."""
    h = np.clip(height, -1, 1)
    return (np.arccos(-h) + h * np.sqrt(1 - h * h)) / np.pi


def half_plane(y: float = 2.0, reach: float = 200.0) -> Scene:
    """What lies at x < 0 at a height y."""
    corners = [(0, y, -reach), (0, y, reach), (-2 * reach, y, 0)]
    return Scene(np.array(corners, np.float32), np.array([[0, 1, 2]]))


@pytest.mark.parametrize("count", [16, 32, 64])
def test_penumbra_of_a_straight_edge_is_the_share_of_a_disc_beside_a_line(count):
    # Light of radius 0.5 at height 6, edge at height 2: seen from x on the ground, the edge cuts the disc's plane
    # (which hardly turns here) at -2 x.
    scene, light = half_plane(), Light.point((0, 6, 0), radius=0.5)
    x = np.linspace(-0.6, 0.6, 481)
    samples = ViewSamples.points(np.stack(np.broadcast_arrays(x, 0.0, np.linspace(-0.05, 0.05, 12)[:, None]), axis=-1))
    mask = shadow(scene, light, samples, method=Frustum(light_samples=count))
    share = mask.transmittance[..., 0].astype(np.float64)
    # Exactly those light samples are seen whose ray passes the edge.
    lights = light_samples(light, samples, count).astype(np.float64)
    ground = samples.position.reshape(-1, 1, 3).astype(np.float64)
    along = 2 / lights[..., 1]
    np.testing.assert_array_equal(
        bits_of(scene, light, samples, count), ground[..., 0] * (1 - along) + lights[..., 0] * along < 0
    )
    # And they stand for the area. Order n**(1/4) is what the best patterns of n points miss of some half-plane.
    missed = count * (share - covered_share(4 * x))
    assert np.abs(missed).max() < 1.5 * count**0.25
    assert np.sqrt((missed**2).mean()) < 0.5 * count**0.25
    assert np.abs(missed.mean(axis=0)).max() < 0.75 * count**0.25
    assert np.abs(missed.mean()) < 0.05
    # Umbra and lit ground, exactly: the disc's tilt moves the ends by less than a thousandth.
    assert (share[:, x < -0.251] == 0).all()
    assert (share[:, x > 0.251] == 1).all()
    np.testing.assert_array_equal(mask.in_shadow, share == 0)


def test_penumbra_of_a_sun_is_as_wide_as_its_diameter():
    scene, light = half_plane(), Light.directional((0, -1, 0), angular_diameter=10)
    wide = 2 * np.tan(np.radians(5))
    x = np.linspace(-1, 1, 2001)
    samples = ViewSamples.points(np.stack(np.broadcast_arrays(x, 0.0, 0.0), axis=-1))
    mask = shadow(scene, light, samples, method=Frustum(light_samples=64))
    share = mask.transmittance[:, 0]
    assert (share[x < -wide] == 0).all()
    assert (share[x > wide] == 1).all()
    # Equal solid angles, not equal areas in a plane across the axis: alike to half a hundredth for so small a sun.
    assert np.abs(share - covered_share(x / wide)).max() < 1.5 * 64**0.25 / 64 + 0.005


def test_light_grows_monotonically_from_umbra_to_lit():
    scene, light = half_plane(), Light.point((0, 6, 0), radius=0.5)
    # One sample at a time: each is the first of its list, and all see the same places of the light.
    shares = [
        float(shadow(scene, light, ViewSamples.points([[x, 0, 0]])).transmittance[0, 0])
        for x in np.linspace(-0.3, 0.3, 41)
    ]
    assert (np.diff(shares) >= 0).all()
    assert (shares[0], shares[-1]) == (0, 1)
    assert len(set(shares)) > 12


def test_a_larger_light_makes_a_smaller_umbra_and_a_larger_penumbra():
    scene = sphere((0, 2, 0), 0.5, 48, 24)
    grid = np.stack(np.broadcast_arrays(np.linspace(-2, 2, 81), 0.0, np.linspace(-2, 2, 81)[:, None]), axis=-1)
    samples = ViewSamples.points(grid)
    away = np.hypot(grid[..., 0], grid[..., 2])
    umbras, penumbras = [], []
    for radius in (0.05, 0.2, 0.4):
        share = shadow(scene, Light.point((0, 8, 0), radius=radius), samples).transmittance[..., 0]
        umbras.append((share == 0).sum())
        penumbras.append(((share > 0) & (share < 1)).sum())
        # Cones that touch ball and lamp (from the same side, or from opposite ones) bound umbra and penumbra.
        slope_umbra, slope_lit = np.arcsin((0.5 - radius) / 6), np.arcsin((0.5 + radius) / 6)
        umbra = 0.5 / np.cos(slope_umbra) + np.tan(slope_umbra) * 2
        lit = 0.5 / np.cos(slope_lit) + np.tan(slope_lit) * 2
        assert (share[away < 0.97 * umbra] == 0).all()
        assert (share[away > 1.01 * lit] == 1).all()
    assert umbras[0] > umbras[1] > umbras[2] > 0
    assert penumbras[0] < penumbras[1] < penumbras[2]


def test_a_convex_solid_is_lit_by_the_part_of_the_light_before_each_face_and_by_no_less():
    ball = sphere((0, 0, 0), 1.0, 20, 10)
    count = len(ball.triangles)
    samples = ViewSamples.on_surface(ball, np.arange(count), np.full((count, 2), 0.25), 1)
    for light in (Light.point((1, 3, 0.5), radius=0.7), Light.directional((1, -1, 0.2), angular_diameter=30)):
        found = bits_of(ball, light, samples, 24)
        lights = light_samples(light, samples, 24)
        truth = np.zeros((count, 24), bool)
        for index in range(count):
            for number in range(24):
                truth[index, number] = Exact(ball, Light(lights[index, number])).facing(index) < 0
        np.testing.assert_array_equal(found, truth)
        partly = truth.any(axis=1) & ~truth.all(axis=1)
        assert partly.sum() > 10


def test_a_sheet_through_the_lamp_hides_the_half_beyond_it():
    # x = 0, through the middle of the lamp: a sample at x > 0 sees the light samples at x > 0 only.
    scene = Scene(np.array([[0, -9, -9], [0, -9, 9], [0, 9, 0]], np.float32), np.array([[0, 1, 2]]))
    light = Light.point((0, 2, 0), radius=0.5)
    samples = ViewSamples.points(np.random.default_rng(4).uniform((0.1, -1, -1), (1, 1, 1), (50, 3)))
    found = bits_of(scene, light, samples, 40)
    np.testing.assert_array_equal(found, light_samples(light, samples, 40)[..., 0] < 0)


# ---- any other method, and what does not work ----


class Plain(Oracle):
    """A method that knows nothing of lights with a size."""

    accepts = ("pictures", "points")


def test_any_method_averages_over_the_same_light_samples_for_all():
    scene = half_plane()
    light = Light.point((0, 6, 0), radius=0.5)
    samples = ViewSamples.points(np.stack(np.broadcast_arrays(np.linspace(-0.5, 0.5, 101), 0.0, 0.0), axis=-1))
    method = Plain(light_samples=20)
    caster = method.prepare(scene)
    mask = cast_shadow(method, caster, light, samples)
    parts = [shadow(scene, Light(one), samples) for one in fixed_samples(light, np.zeros(3), 20)]
    wanted = np.mean([part.transmittance for part in parts], axis=0, dtype=np.float64)
    np.testing.assert_array_equal(mask.transmittance, wanted.astype(np.float32))
    np.testing.assert_array_equal(mask.in_shadow, np.all([part.in_shadow for part in parts], axis=0))
    assert mask.guarantee is Guarantee.NONE
    assert mask.stats["light_samples"] == 20
    assert mask.stats["predicate_fallbacks"] == sum(part.stats["predicate_fallbacks"] for part in parts)
    assert np.unique(mask.transmittance[:, 0]).size > 10
    assert (np.diff(mask.transmittance[:, 0]) >= 0).all()
    one = average_over_light(caster, light, samples, 1)
    np.testing.assert_array_equal(one.in_shadow, shadow(scene, Light.point((0, 6, 0)), samples).in_shadow)
    assert not cast_shadow(method, caster, Light.point((0, 6, 0)), samples).partial


def test_average_and_frustum_agree_about_umbra_and_lit_ground():
    scene, samples = finely_tessellated()
    light = Light.directional((-1, -2, -0.7), angular_diameter=2)
    exact = shadow(scene, light, samples, method=Frustum(light_samples=64)).transmittance
    mean = cast_shadow(Plain(), Plain().prepare(scene), light, samples).transmittance
    assert np.abs(exact - mean).mean() < 0.01
    assert np.abs(exact - mean).max() < 0.35


def test_empty_scenes_and_no_samples():
    empty = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    mask = shadow(empty, LAMP, ViewSamples.points([[0, 0, 0], [1, 2, 3]]))
    assert mask.transmittance.tolist() == [[1, 1, 1], [1, 1, 1]]
    nothing = shadow(random_soup(np.random.default_rng(0), 3), LAMP, ViewSamples.points(np.zeros((0, 3))))
    assert isinstance(nothing, ShadowMask)
    assert nothing.transmittance.shape == (0, 3)


def test_light_samples_are_an_option_of_every_method():
    assert make_method("frustum", light_samples=8).options()["light_samples"] == 8
    with pytest.raises(OptionError, match="wanted 1 to 64 light samples, got 65"):
        make_method("frustum", light_samples=65)
    scene = half_plane()
    samples = ViewSamples.points([[0, 0, 0]])
    share = shadow(scene, Light.point((0, 6, 0), radius=0.5), samples, method=Frustum(light_samples=8)).transmittance
    assert share[0, 0] * 8 == round(float(share[0, 0]) * 8)


# ---- the command line's texts ----


def test_radius_and_diameter_belong_to_point_lights_and_suns():
    scene = half_plane()
    view, up = Camera.frame(scene), arguments.Vector(0, 1, 0)
    point, sun = arguments.Vector(0, 6, 0), arguments.Sun(120, 40)
    lamp, star = arguments.lights(scene, view, [point], [sun], up, radius=0.5, diameter=0.53)
    assert (lamp.radius, lamp.angular_diameter, star.radius, star.angular_diameter) == (0.5, 0, 0, 0.53)
    hard = arguments.lights(scene, view, [point], [sun], up)
    assert not any(light.is_area for light in hard)
    (default,) = arguments.lights(scene, view, [], [], up, diameter=2.0)
    assert default.is_directional
    assert default.angular_diameter == 2.0
    with pytest.raises(OptionError, match=r"--light-radius: wanted a point light \(--light\)"):
        arguments.lights(scene, view, [], [sun], up, radius=0.5)
    with pytest.raises(OptionError, match=r"--sun-diameter: wanted a sun \(--sun\)"):
        arguments.lights(scene, view, [point], [], up, diameter=0.5)
