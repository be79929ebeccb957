"""The frustum method against the oracle where the small scenes do not reach: size, distance, threads, options."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from truth import lattice_soup, random_samples, random_soup
from umbrae import METHODS, Camera, Light, Material, Scene, ViewSamples, sample, shadow, verify
from umbrae.geometry.solids import find_solids
from umbrae.mask import add_stats
from umbrae.methods import frustum_cpu
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.light_frame import light_frames
from umbrae.methods.triangle_clusters import cluster_triangles
from umbrae.models import sphere, spheres, spheres_light

LIGHTS = [
    (0, 5, 0, 1), (1, 1, 1, 0), (3, -2, 1, 1), (0, 0, 1, 0), (0, 0, 0, 1),
    (0.1, 0.2, 0.05, 1), (1e6, 2e6, 1e5, 1), (1e12, -3e12, 1e11, 1), (-3, -1, 0, 0), (1e-20, 1e-20, -1e-20, 0),
]  # fmt: skip


@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
@pytest.mark.parametrize("count", [1, 40, 2500])
@pytest.mark.parametrize("position", LIGHTS)
def test_every_sample_agrees_with_the_oracle(soup, count, position):
    rng = np.random.default_rng(count)
    scene, light = soup(rng, count), Light(np.array(position))
    for samples in (random_samples(rng, scene, 700), ViewSamples.points(rng.integers(-12, 13, (700, 3)) / 4)):
        mask = shadow(scene, light, samples, method="frustum")
        assert verify(scene, light, samples, mask).mismatches == 0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6, 1e15])
def test_scale_does_not_matter(scale):
    rng = np.random.default_rng(4)
    unit = random_soup(rng, 300)
    scene = Scene((unit.positions * np.float32(scale)), unit.triangles)
    samples = random_samples(rng, scene, 500)
    light = Light.point(np.array([0.3, 2.0, 0.7]) * scale)
    mask = shadow(scene, light, samples)
    assert verify(scene, light, samples, mask).mismatches == 0
    assert 0.05 < mask.in_shadow.mean() < 0.999


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-12, 1e-7, 1e-4])
def test_samples_at_and_next_to_a_point_light(gap):
    rng = np.random.default_rng(6)
    scene = random_soup(rng, 200)
    light = Light.point((0.25, 0.5, -0.125))
    points = np.array([0.25, 0.5, -0.125]) + gap * rng.normal(size=(40, 3))
    samples = ViewSamples.points(np.concatenate([points, rng.uniform(-1, 1, (200, 3))]))
    mask = shadow(scene, light, samples)
    assert verify(scene, light, samples, mask).mismatches == 0


def test_sensors_on_a_triangle_that_holds_the_light():
    scene = random_soup(np.random.default_rng(8), 100)
    rng = np.random.default_rng(9)
    for corner in range(3):
        light = Light.point(scene.positions[scene.triangles[17, corner]])
        samples = random_samples(rng, scene, 400)
        mask = shadow(scene, light, samples)
        assert verify(scene, light, samples, mask).mismatches == 0


def small_spheres() -> tuple[Scene, Camera]:
    scene = spheres(grid=(3, 3), triangles=4000)
    return scene, Camera.frame(scene, width=160, height=90)


@pytest.mark.parametrize("light", [spheres_light((3, 3)), Light.directional((-1, -2, -0.7)), Light.point((0, 0.01, 0))])
def test_whole_picture_agrees_with_the_oracle(light):
    scene, camera = small_spheres()
    samples = sample(scene, camera)
    mask = shadow(scene, light, samples)
    verdict = verify(scene, light, samples, mask)
    assert verdict.mismatches == 0
    assert verdict.checked == samples.covered.sum() > 1000
    assert 0 < mask.in_shadow.mean() < 1
    assert set(mask.stats) >= {
        "tile_frustum_tests",
        "sample_frustum_tests",
        "accepts",
        "rejects",
        "predicate_fallbacks",
    }
    assert mask.stats["sample_frustum_tests"] < samples.covered.sum() * len(scene.triangles) / 50


def test_supersampled_picture_is_one_large_picture():
    scene, camera = small_spheres()
    samples = sample(scene, camera, samples_per_pixel=3)
    mask = shadow(scene, spheres_light((3, 3)), samples)
    assert mask.in_shadow.shape == (90, 160, 3)
    assert verify(scene, spheres_light((3, 3)), samples, mask, count=3000).mismatches == 0


def test_verify_notices_a_wrong_mask():
    scene, camera = small_spheres()
    samples, light = sample(scene, camera), spheres_light((3, 3))
    mask = shadow(scene, light, samples)
    first = tuple(np.argwhere(samples.covered)[100])
    mask.in_shadow[first] = not mask.in_shadow[first]
    verdict = verify(scene, light, samples, mask)
    assert (verdict.mismatches, verdict.outside_band, verdict.ok) == (1, 1, False)
    assert np.unravel_index(verdict.wrong[0], samples.shape) == first
    assert verdict.worst_margin > 0


def test_result_does_not_depend_on_threads(monkeypatch):
    scene, camera = small_spheres()
    samples, light = sample(scene, camera), spheres_light((3, 3))
    masks = []
    for threads in ("1", "5"):
        monkeypatch.setenv("UMBRAE_THREADS", threads)
        masks.append(shadow(scene, light, samples).in_shadow)
    np.testing.assert_array_equal(masks[0], masks[1])


CULLING = METHODS["frustum"](front_face_culling=True)


@pytest.mark.parametrize(
    "light", [spheres_light((3, 3)), Light.directional((-1, -2, -0.7)), Light.directional((0, -1, 0))]
)
def test_front_face_culling_halves_the_work_and_changes_nothing(light):
    scene, camera = small_spheres()
    samples = sample(scene, camera)
    plain, culled = shadow(scene, light, samples), shadow(scene, light, samples, method=CULLING)
    np.testing.assert_array_equal(plain.in_shadow, culled.in_shadow)
    assert culled.stats["tile_frustum_tests"] < 0.75 * plain.stats["tile_frustum_tests"]


def test_front_face_culling_with_eye_or_light_inside_a_solid_or_none_at_all():
    scene = sphere((0, 0, 0), 1.0, 24, 12)
    ground = Scene(np.array([[-3, -1, -3], [3, -1, -3], [0, -1, 4]], np.float32), np.array([[0, 1, 2]]))
    both = Scene(
        np.concatenate([scene.positions, ground.positions]),
        np.concatenate([scene.triangles, ground.triangles + len(scene.positions)]),
    )
    for eye in ((0.2, 0.1, 0.0), (0, 2, 5)):
        samples = sample(both, Camera.look_at(eye, (0.5, -0.3, -1), width=64, height=48))
        for light in (Light.point((0.1, 0.3, 0.2)), Light.point((1, 4, 2)), Light.directional((0, -1, 0))):
            mask = shadow(both, light, samples, method=CULLING)
            assert verify(both, light, samples, mask).mismatches == 0


def test_cube_on_the_ground_seen_exactly_along_its_walls():
    # Where a wall meets the ground, samples lie on the plane of the edge-on wall and on the bottom face's edge.
    from test_convex import CUBE, CUBE_FACES

    ground = np.array([[-4, -1, -4], [4, -1, -4], [4, -1, 4], [-4, -1, 4]], np.float32)
    scene = Scene(
        np.concatenate([CUBE.astype(np.float32), ground]),
        np.concatenate([CUBE_FACES, [[8, 10, 9], [8, 11, 10]]]),
    )
    camera = Camera.look_at((2.0, 3.0, 5.0), (0.0, 0.0, 0.0), width=32, height=24)
    light = Light.directional((0, -1, 0))
    grid = np.linspace(0, 1, 17)
    u, v = (part.reshape(-1) for part in np.meshgrid(grid, grid))
    keep = u + v <= 1
    sensors = ViewSamples.on_surface(scene, np.full(keep.sum(), 12), np.stack([u, v], axis=1)[keep], 1)
    as_if_seen = ViewSamples(
        *(getattr(sensors, name)[None] for name in ("triangle", "barycentric", "side", "position", "covered")),
        camera=camera,
    )
    mask = shadow(scene, light, as_if_seen, method=CULLING)
    on_wall = (np.abs(sensors.position[:, 0]) <= 1) & (np.abs(sensors.position[:, 2]) <= 1)
    np.testing.assert_array_equal(mask.in_shadow[0], on_wall)


def test_solids_are_closed_and_outward_parts_only():
    ball = sphere((0, 0, 0), 1.0, 8, 5)
    count = len(ball.triangles)
    positions = np.concatenate([ball.positions + np.float32(3 * k) for k in range(4)])
    parts = [ball.triangles + k * len(ball.positions) for k in range(4)]
    parts[1] = parts[1][:, ::-1]  # inside out
    parts[2] = parts[2][1:]  # open
    triangles = np.concatenate(parts)
    allowed = np.ones(len(triangles), bool)
    allowed[-1] = False  # glass in the last
    solids = find_solids(positions, triangles, allowed)
    assert (solids.of >= 0).tolist() == [True] * count + [False] * (len(triangles) - count)
    np.testing.assert_allclose(solids.upper[0], 1.0, atol=0.2)


def test_light_frames_cover_the_scene():
    bounds = np.array([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]])
    assert len(light_frames(np.array([1.0, 2.0, 3.0, 0.0]), bounds, 1e-7)) == 1
    (far,) = light_frames(np.array([100.0, 5.0, 7.0, 1.0]), bounds, 1e-7)
    assert (far.axis_c, far.sign) == (0, -1.0)
    assert far.hx < 0.1
    # From just outside a face the scene is seen under wider angles than one frame may have; from inside all around.
    for near in ((1.1, 0.0, 0.0, 1.0), (0.5, 0.0, 0.0, 1.0)):
        assert len(light_frames(np.array(near), bounds, 1e-7)) == 6


@pytest.mark.parametrize("distance", [1.05, 1.3, 1.6, 2.0, 3.0])
def test_point_lights_near_the_scene_see_it_in_one_frame_or_six(distance):
    rng = np.random.default_rng(11)
    scene = random_soup(rng, 400)
    middle, reach = scene.bounds.mean(axis=0), np.abs(scene.bounds - scene.bounds.mean(axis=0)).max()
    samples = random_samples(rng, scene, 900)
    for direction in ((1, 0, 0), (0, -1, 0.2), (-0.3, 0.1, 1)):
        light = Light.point(middle + distance * reach * np.array(direction))
        assert verify(scene, light, samples, shadow(scene, light, samples)).mismatches == 0


def test_order_of_triangles_only_changes_how_they_are_clustered():
    scene, camera = small_spheres()
    shuffle = np.random.default_rng(3).permutation(len(scene.triangles))
    mixed = Scene(scene.positions, scene.triangles[shuffle])
    light = spheres_light((3, 3))
    plain, shuffled = (shadow(one, light, sample(one, camera)) for one in (scene, mixed))
    np.testing.assert_array_equal(plain.in_shadow, shuffled.in_shadow)
    # Put along a curve, they need little more work than in the order of the mesh; left alone, many times as much.
    assert shuffled.stats["tile_frustum_tests"] < 2 * plain.stats["tile_frustum_tests"]
    kept, moved = (cluster_triangles(one, None).order for one in (scene, mixed))
    assert (kept == np.arange(len(kept))).all()
    assert (np.sort(moved) == kept).all()


def test_a_caster_may_be_asked_by_several_threads_and_again():
    scene, camera = small_spheres()
    samples = sample(scene, camera)
    caster = Frustum().prepare(scene)
    lights = [spheres_light((3, 3)), Light.directional((-1, -2, -0.7)), Light.directional((1, -2, 0.5))] * 3
    wanted = [shadow(scene, light, samples).in_shadow for light in lights]
    with ThreadPoolExecutor(3) as pool:
        masks = list(pool.map(lambda light: caster.shadow(light, samples).in_shadow, lights))
    for mask, truth in zip(masks, wanted, strict=True):
        np.testing.assert_array_equal(mask, truth)


def test_memory_is_that_of_leaves_boxes_flags_and_sums(monkeypatch):
    # 17 leaves of 16 points each in a patch of the floor: two groups of 16, and the root above them, which is one of
    # the two children of a node that stands alone.
    grid = np.stack(np.meshgrid(np.arange(16), [0], np.arange(17), indexing="ij"), axis=-1).reshape(-1, 3) / 4096
    points = ViewSamples.points(grid)
    positions, triangles, sun = [(-9, 1, -9), (9, 1, -9), (0, 1, 9)], [(0, 1, 2)], Light.directional((0, -1, 0))
    leaf = 4 * (3 * 16 + 2 * 16 + 8) + 8  # places, numbers, bounds with slack; the key
    tree = 4 * 17 + 4 * (4 * 6 * 16)  # where leaves are; six bounds of each child
    flags, rows = 4 * 16, 4 + 17
    solid = shadow(Scene(positions, triangles), sun, points)
    assert solid.in_shadow.all()
    assert solid.stats["hierarchy_bytes"] == 17 * leaf + tree
    assert solid.stats["shadow_buffer_bytes"] == flags
    glass = Scene(positions, triangles, [Material((1.0, 1.0, 1.0, 0.5), "BLEND")])
    # By chance first: what is kept for later has no sums then. And after sums, which are kept, there are none either.
    for transparency, each in (("stochastic", 1), ("exact", 1 + 8), ("stochastic", 1)):
        stats = shadow(glass, sun, points, method=Frustum(transparency=transparency)).stats
        assert stats["hierarchy_bytes"] == 17 * leaf + tree
        assert stats["shadow_buffer_bytes"] == flags + rows * 3 * 16 * each
    # Block by block it is the same memory again.
    monkeypatch.setattr(frustum_cpu, "BLOCK", 16 * 4)
    by_blocks = shadow(Scene(positions, triangles), sun, points)
    assert by_blocks.stats["hierarchy_bytes"] == 4 * leaf + 4 * 4 + 2 * 4 * 6 * 16
    assert by_blocks.stats["shadow_buffer_bytes"] == 2 * 16


def test_counters_add_up_and_memory_does_not():
    total = {"accepts": 3, "hierarchy_bytes": 40}
    add_stats(total, {"accepts": 4, "hierarchy_bytes": 30, "shadow_buffer_bytes": 8})
    assert total == {"accepts": 7, "hierarchy_bytes": 40, "shadow_buffer_bytes": 8}
    add_stats(total, {"hierarchy_bytes": 50})
    assert total["hierarchy_bytes"] == 50


def test_empty_scene_and_no_samples():
    empty = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    light = Light.point((0, 1, 0))
    assert not shadow(empty, light, ViewSamples.points([[0, 0, 0], [1, 2, 3]])).in_shadow.any()
    assert (
        shadow(random_soup(np.random.default_rng(0), 3), light, ViewSamples.points(np.zeros((0, 3)))).in_shadow.size
        == 0
    )
    assert Frustum().options() == {
        "light_samples": 32,
        "culling": True,
        "front_face_culling": False,
        "transparency": "exact",
        "seed": 0,
    }
