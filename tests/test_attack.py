"""Inputs made to break what is claimed to be exact: each of these once gave a wrong mask, or nearly could."""

import _thread
import threading
import time

import numpy as np
import pytest
from numpy.typing import ArrayLike

from truth import lattice_soup, random_samples, random_soup, rational_truth
from umbrae import METHODS, Camera, Light, Scene, ShadowMask, ViewSamples, sample, shadow, verify
from umbrae.geometry.solids import find_solids
from umbrae.mask import Guarantee
from umbrae.methods.oracle import Oracle
from umbrae.models import sphere
from umbrae.parallel import run

CULLING = METHODS["frustum"](front_face_culling=True)


def soup(*triangles: ArrayLike) -> Scene:
    """A scene of separate triangles, coordinates rounded to float32."""
    corners = np.array(triangles, np.float64).reshape(-1, 3).astype(np.float32)
    return Scene(corners, np.arange(len(corners)).reshape(-1, 3))


def points(*rows: ArrayLike) -> ViewSamples:
    return ViewSamples.points(np.array(rows, np.float32).reshape(-1, 3))


def assert_exact(scene: Scene, light: Light, samples: ViewSamples, shadowed: bool | None = None) -> None:
    """Frustum, with and without culling, and oracle against plain rationals; `shadowed` says what all must be."""
    truth = rational_truth(scene, light, samples)
    if shadowed is not None:
        assert (truth == shadowed).all(), "the case is not what it is meant to be"
    for method in ("frustum", CULLING, "oracle"):
        np.testing.assert_array_equal(shadow(scene, light, samples, method=method).in_shadow, truth, str(method))


@pytest.mark.parametrize("height", [1e-30, 1e-33, 1e-39, 1e-45])
def test_occluder_a_hair_above_the_sample_in_a_huge_world(height):
    # The coefficient of q in the plane's row is 1e6 / height, more than float32 holds, and q is 0: 0 times infinity.
    low, wall = [(-1, -1, height), (3, -1, height), (-1, 3, height)], [(-1e6, 5, -1e6), (-1e6, 6, -1e6), (-1e6, 5, 1e6)]
    assert_exact(soup(low, wall), Light.directional((0, 0, -1)), points((0, 0, 0), (0.25, 0.5, 0)), shadowed=True)


@pytest.mark.parametrize(("world", "gap"), [(1.0, 1e-40), (1e6, 1e-33), (1e18, 1e-30), (1e18, 1e-43)])
def test_sample_so_near_a_light_that_q_leaves_float32(world, gap):
    low = np.array([(-1, 0.5, -1), (3, 0.5, -1), (-1, 0.5, 3)]) * gap
    ground = np.array([(-1, -1, -1), (1, -1, -1), (0, -1, 1)]) * world
    light = Light.point((0, 0, 0))
    assert_exact(soup(low, ground), light, points((0, gap, 0), (gap * 0.1, gap * 0.9, 0)), shadowed=True)
    assert_exact(soup(low, ground), light, points((0, gap * 0.4, 0), (gap, 0, 0)), shadowed=False)


def test_light_a_billionth_of_a_hair_above_a_large_triangle():
    # n . (l - V0) cancels to 12 digits less than its terms; its error, times a q of 1e12, is what decides.
    triangle = [
        (-0.03861673176288605, -0.5287870168685913, 0.847870945930481),
        (-0.8390319347381592, 0.3553405702114105, -0.41201943159103394),
        (0.8857675790786743, 0.17000286281108856, -0.4318564534187317),
    ]
    beyond = [
        (-1.2224996134759664e-13, -1.0712991908509717e-12, -6.702492293814144e-13),
        (-1.8352950181734634e-13, -1.11158510781445e-12, -5.950161153719935e-13),
        (-1.2481599683932670e-13, -1.0523476621365768e-12, -6.999261196669049e-13),
    ]
    assert_exact(soup(triangle), Light.point((0, 0, 0)), points(*beyond), shadowed=True)
    assert_exact(soup(triangle), Light.point((0, 0, 0)), points(*(0.9 * np.array(beyond))), shadowed=False)


def test_needle_that_turns_over_when_vertices_are_rounded_relative_to_the_light():
    needle = [
        (7.799184231771505e-08, 0.0, -4.972151125795396e-19),
        (0.0, 0.0, 3.6032761723863235e-17),
        (5.794201030084878e-08, 0.0, 1.2668832736885542e-17),
    ]
    light = Light.point((-0.07652254402637482, 0.8033291697502136, 0.4016645848751068))
    behind = (8.079710056563272e-08, -3.899592115885753e-08, -1.9497960579428764e-08)
    further = (9.19409899324819e-08, -1.559836846354301e-07, -7.799184231771505e-08)
    assert_exact(soup(needle), light, points(behind, further), shadowed=True)


def test_occluder_between_a_light_and_the_sample_that_rounds_to_it():
    # The sample is less than half a unit in the last place left of x = 1, where the light is, and so rounds to it.
    # The occluder in between has no vertex right of the light.
    step = 2.0**-24
    own = [(1 - step, 0.5, 1), (1, 1.5, 1), (1 - step, 1, 3)]
    between = [(1, 5, 1), (1 - step, -5, -4), (1 - step, -5, 6)]
    scene = soup(own, between)
    grid = np.stack(np.meshgrid(np.linspace(0.375, 0.625, 9), np.linspace(0, 0.125, 3)), -1).reshape(-1, 2)
    for side in (1, -1, 0):
        samples = ViewSamples.on_surface(scene, np.zeros(len(grid), int), grid, side)
        assert_exact(scene, Light.point((1, 1, 1)), samples)


def test_one_tile_around_a_light_in_all_directions_sure_and_unsure():
    # 11 kinds of directions in a tile that had room for 8 leaves: the rest was written past the end.
    near, far = 1e-20 * np.vstack([np.eye(3), -np.eye(3)]), 1e-6 * np.vstack([np.eye(3), -np.eye(3)])
    around = np.concatenate([near, far, [[0, 0, 0]]]) + np.array([1.0, 0.0, 0.0])
    scene = soup([(-9, 1e-21, -9), (9, 1e-21, -9), (0, 1e-21, 9)], [(-9, -9, -9), (9, -9, -9), (0, -9, 9)])
    assert_exact(scene, Light.point((1, 0, 0)), points(*around))


def test_list_of_open_pairs_that_fills_up_in_the_middle_of_a_triangle():
    # Sixteen points in a leaf. A full list is settled while a triangle's lanes are being sorted into sure and open
    # ones; a lane that both the settling and the triangle darken counted twice, and with it the first point went dark.
    row = np.stack([np.arange(16) / 16, np.zeros(16), np.zeros(16)], axis=1)
    row[15, 2] = 0.01
    x = row[15, 0]
    for coplanar in range(13, 18):
        for twins in (1, 2, 3):
            triangles = [[(-5, 0, -5), (5, 0, -5 - k), (0, 0, 9)] for k in range(coplanar)]
            triangles += [[(x - 0.01, 1, 0.01), (x + 0.01, 1, 0.01), (x, 1, 0.02)]] * twins
            triangles += [[(-2, 1, 1e-9), (3, 1, 1e-9), (0.5, 1, 3)], [(1 / 32, 1, -1), (1 / 32, 1, 1), (6, 1, 0)]]
            mask = shadow(soup(*triangles), Light.directional((0, -1, 0)), points(*row))
            assert mask.in_shadow.tolist() == [False] + [True] * 15


def test_sample_near_zero_on_a_triangle_with_large_coordinates():
    # Half-way between A and -A the position is what rounding leaves; a light and an occluder of that size tell.
    rng = np.random.default_rng(5)
    for _ in range(6):
        a, b = rng.uniform(0.5, 1, 3).astype(np.float32).astype(np.float64), rng.uniform(-1, 1, 3)
        normal = np.cross(b - a, -2 * a)
        normal /= np.linalg.norm(normal)
        size = 10.0 ** rng.uniform(-16, -14)
        occluder = (normal + b - a) * 0.5 * size + np.array([a + b, -2 * a, a - b]) * 0.3 * size
        scene = soup((a, b, -a), occluder)
        uv = np.stack([rng.uniform(0, size, 40), np.full(40, 0.5)], axis=1)
        samples = ViewSamples.on_surface(scene, np.zeros(40, int), uv, 1)
        assert_exact(scene, Light.point(normal * 3 * size), samples)


@pytest.mark.parametrize("scale", [1e-38, 1e-41, 1e-43, 1e-44])
def test_coordinates_below_the_normal_numbers_of_float32(scale):
    rng = np.random.default_rng(3)
    for _ in range(2):
        unit = random_soup(rng, 12)
        scene = Scene(unit.positions * np.float32(scale), unit.triangles)
        samples = random_samples(rng, scene, 40)
        for light in (Light.directional((-1, -2, -0.5)), Light.point((0, 3 * scale, scale)), Light.point((0, 1, 0))):
            assert_exact(scene, light, samples)


@pytest.mark.parametrize("seed", range(4))
def test_mixed_scales_and_lights_in_every_bad_place(seed):
    rng = np.random.default_rng(seed)
    for _ in range(12):
        centers = rng.uniform(-1, 1, (8, 1, 3)) * 10.0 ** rng.uniform(-12, 0, (8, 1, 1))
        scene = soup(*(centers + rng.normal(size=(8, 3, 3)) * 10.0 ** rng.uniform(-14, 2, (8, 1, 1))))
        a, b, c = scene.positions[scene.triangles[rng.integers(8)]].astype(np.float64)
        lights = [
            Light.point(a),
            Light.point((a + b + c) / 3),
            Light.point((a + b + c) / 3 + rng.normal(size=3) * 10.0 ** rng.uniform(-14, -6)),
            Light.point(rng.normal(size=3) * 10.0 ** rng.uniform(3, 17)),
            Light.directional(b - a if (b != a).any() else c),
            Light.directional(rng.normal(size=3) * 10.0 ** rng.choice([0, -15, -30, 15], 3)),
        ]
        light = lights[rng.integers(len(lights))]
        source = light.position[:3].astype(np.float64)
        targets = scene.positions[scene.triangles[rng.integers(0, 8, 20)]].astype(np.float64).mean(axis=1)
        away = targets - source if light.position[3] else np.broadcast_to(-source / np.abs(source).max(), (20, 3))
        free = targets + away * rng.choice([1e-6, 0.1, 1.0, -0.5, 0.0], (20, 1))
        assert_exact(scene, light, points(*np.clip(free, -1e18, 1e18)))
        assert_exact(scene, light, random_samples(rng, scene, 20))


@pytest.mark.parametrize("leaves", [1, 8, 9, 64, 65])
def test_trees_of_every_shape_and_whole_batches(leaves):
    rng = np.random.default_rng(leaves)
    for count in (1024, 1025):
        scene, light = random_soup(rng, count, 0.1), Light.point((0.5, 3.0, 0.25))
        samples = points(*rng.uniform(-1.5, 1.5, (16 * leaves, 3)))
        assert verify(scene, light, samples, shadow(scene, light, samples)).mismatches == 0


def hourglass() -> tuple[np.ndarray, np.ndarray]:
    """A closed prism that crosses itself: a large lobe above y = 1, and below it a small one that is inside out."""
    outline = [(2.0, 3.0), (-2.0, 3.0), (1.0, -0.5), (-1.0, -0.5)]
    corners = np.array([(x, y, z) for z in (-2.0, 2.0) for x, y in outline])
    faces = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    for i in range(4):
        j = (i + 1) % 4
        faces += [(i, j, 4 + j), (i, 4 + j, 4 + i)]
    return corners, np.array(faces)


def test_lobes_that_are_inside_out_are_no_solids():
    # The volume is positive, every edge balanced; but from inside the small lobe the way out is through triangles that
    # face away from the light. Samples of a large ground come to lie there by the rounding of their barycentrics.
    corners, faces = hourglass()
    volume = np.linalg.det(corners[faces]).sum() / 6
    faces = faces if volume > 0 else faces[:, ::-1]
    allowed = np.ones(len(faces), bool)
    assert (find_solids(corners.astype(np.float32), faces.astype(np.int32), allowed).of == -1).all()
    size = 1e5
    ground = np.array([(-size, 0, -size), (size, 0, -1.1 * size), (0.9 * size, 0, size), (-size, 0, size)])
    scene = Scene(
        np.concatenate([corners, ground]).astype(np.float32), np.concatenate([faces, [[8, 10, 9], [8, 11, 10]]])
    )
    samples = sample(scene, Camera.look_at((-4, 1.5, -3), (0, 0, 0), fov_y=40, width=320, height=240))
    light = Light.directional((0.4, -1, 0.1))
    plain, culled = shadow(scene, light, samples), shadow(scene, light, samples, method=CULLING)
    np.testing.assert_array_equal(plain.in_shadow, culled.in_shadow)
    inside = points((0, 0.25, 0), (0.1, -0.25, 1))
    assert_exact(Scene(corners, faces), light, inside, shadowed=True)


def test_culled_solids_touching_and_nested_with_samples_inside_and_on_them():
    rng = np.random.default_rng(4)
    ball = sphere((0, 0, 0), 1.0, 6, 4)
    culled = 0
    for _ in range(25):
        parts = [ball.positions * rng.integers(1, 4, 3) / 2 + rng.integers(-2, 3, 3) for _ in range(4)]
        triangles = np.concatenate([ball.triangles + k * len(ball.positions) for k in range(4)])
        scene = Scene(np.concatenate(parts).astype(np.float32), triangles)
        light = Light(np.append(rng.integers(-6, 7, 3) + 0.5, rng.integers(0, 2)))
        for samples in (random_samples(rng, scene, 200), points(*rng.integers(-8, 9, (200, 3)) / 2)):
            plain, fewer = shadow(scene, light, samples), shadow(scene, light, samples, method=CULLING)
            np.testing.assert_array_equal(plain.in_shadow, fewer.in_shadow)
            culled += fewer.stats["sample_frustum_tests"] < plain.stats["sample_frustum_tests"]
    assert culled > 20, "nothing was culled: this tests nothing"


def test_a_step_as_long_as_the_margin_does_not_reach_the_plane():
    # Strictly beyond the plane is in shadow, on it is not: a margin rounded up to the depth would be too long.
    scene, light = soup([(-9, 1, -9), (9, 1, -9), (0, 1, 9)]), Light.directional((0, -1, 0))
    samples = points(*[(0, 1 - depth, 0) for depth in 2.0 ** np.linspace(-20, -3, 60)])
    oracle = Oracle().prepare(scene)
    in_shadow = oracle.shadow(light, samples).in_shadow
    margin, depth = oracle.margin(light, samples, in_shadow), 1 - samples.position[:, 1]
    assert in_shadow.all()
    assert (margin < depth).all()
    assert (margin > 0.999999 * depth).all()


def test_a_band_excuses_nothing_that_was_promised_exactly():
    scene, light = soup([(-1, 1, -1), (1, 1, -1), (0, 1, 1)]), Light.directional((0, -1, 0))
    samples = points((0, 0, 0), (0, 0, 0.5), (3, 0, 0))
    wrong, band = ~shadow(scene, light, samples).in_shadow, np.full(3, np.inf, np.float32)
    for guarantee, inside in ((Guarantee.EXACT, 0), (Guarantee.NONE, 0), (Guarantee.BANDED, 3)):
        verdict = verify(scene, light, samples, ShadowMask(wrong, guarantee, band))
        assert (verdict.inside_band, verdict.outside_band, verdict.ok) == (inside, 3 - inside, inside == 3)


def test_threads_that_fight_for_the_same_leaves_agree_with_one(monkeypatch):
    rng = np.random.default_rng(7)
    scene, light = lattice_soup(rng, 6000), Light.directional((0.1, -1.0, 0.2))
    samples = points(*rng.integers(-8, 9, (2000, 3)) / 2)
    monkeypatch.setenv("UMBRAE_THREADS", "1")
    alone = shadow(scene, light, samples).in_shadow
    assert 0.1 < alone.mean() < 0.9
    monkeypatch.setenv("UMBRAE_THREADS", "8")
    for _ in range(20):
        np.testing.assert_array_equal(shadow(scene, light, samples).in_shadow, alone)


def test_a_run_within_a_run_ends(monkeypatch):
    monkeypatch.setenv("UMBRAE_THREADS", "2")
    sums: list[list[int]] = []
    caller = threading.Thread(target=lambda: sums.append(run(lambda i: sum(run(lambda j: i * j, 4)), 4)), daemon=True)
    caller.start()
    caller.join(10)
    assert sums == [[0, 6, 12, 18]]


def test_interruption_stops_the_queue_and_leaves_the_threads_usable(monkeypatch):
    monkeypatch.setenv("UMBRAE_THREADS", "2")
    started: list[int] = []

    def task(index: int) -> int:
        started.append(index)
        time.sleep(0.01)
        return index

    timer = threading.Timer(0.2, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        run(task, 2000)
    timer.join()
    count = len(started)
    assert count < 1000
    time.sleep(0.1)
    assert len(started) == count
    assert run(task, 10) == list(range(10))
