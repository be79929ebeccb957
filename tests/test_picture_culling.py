"""Culling of the picture: every sample is what it is without, and little of a street is drawn."""

import numpy as np
import pytest
from numpy.typing import NDArray

import towns
from umbrae import models
from umbrae.camera import Camera
from umbrae.material import Material
from umbrae.samples import ViewSamples
from umbrae.sampling import sample_layers
from umbrae.sampling.bands import Picture
from umbrae.sampling.cpu import Bands
from umbrae.sampling.groups import SIZE, Groups, View, groups_of
from umbrae.sampling.seen import picture_of
from umbrae.scene import Scene

ARRAYS = ("triangle", "barycentric", "side", "position", "covered", "depth")


def view_of_all(groups: Groups, picture: Picture) -> View:
    """All groups as they come, anywhere in the picture."""
    count = len(groups.lower)
    rows, columns = (np.tile(np.array([0, side - 1], np.int32), (count, 1)) for side in (picture.height, picture.width))
    return View(groups.order, np.arange(count, dtype=np.int32), rows, columns, np.zeros(count), np.zeros(count, bool))


def seen(scene: Scene, camera: Camera, culling: bool, per_pixel: int = 1) -> tuple[ViewSamples, int]:
    """The picture, and how many triangles were drawn."""
    picture = picture_of(scene, camera, per_pixel)
    bands = Bands.of(scene, camera, picture)
    if not culling:
        bands = bands._replace(view=view_of_all(groups_of(scene), picture))
    return bands.nearest().samples(scene, camera), bands.view.triangles


def assert_same(scene: Scene, camera: Camera, per_pixel: int = 1) -> float:
    """Hold the picture against that without culling; returns the share of triangles that were drawn."""
    (one, drawn), (other, all_of_them) = (seen(scene, camera, culling, per_pixel) for culling in (True, False))
    assert all_of_them == len(scene.triangles)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    return drawn / len(scene.triangles)


def soup(rng: np.random.Generator, count: int, size: float, grid: bool) -> Scene:
    points = rng.uniform(-5, 5, (count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size
    points = np.rint(points) if grid else points
    return Scene(points.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize("seed", range(40))
def test_random_soups_from_anywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = soup(rng, int(rng.integers(1, 3000)), float(rng.choice([0.01, 0.3, 5.0])), grid=seed % 3 == 0)
    eye: NDArray[np.float64] = rng.uniform(-6, 6, 3)
    eye = np.rint(eye) if seed % 2 else eye  # in the planes of triangles of a grid, and on their vertices
    near = float(rng.choice([1e-3, 0.1, 2.0]))
    camera = Camera.look_at(eye, eye + rng.normal(size=3), width=97, height=61, near=near)
    assert_same(scene, camera, per_pixel=int(rng.choice([1, 4])))


@pytest.mark.parametrize("scale", [1e-18, 1e-3, 1e9, 1e15])
def test_any_scale(scale: float) -> None:
    town = towns.town(16)
    scene = Scene(town.positions * np.float32(scale), town.triangles)
    eye = np.array([-2.0, 2.0, -100.0]) * scale
    camera = Camera.look_at(eye, eye + np.array([0.1, 0, 1]) * scale, width=80, height=60, near=1e-3 * scale)
    assert assert_same(scene, camera) < 0.5


def test_far_from_the_origin_rounding_moves_boxes_and_vertices_alike() -> None:
    town = towns.town(6)
    scene = Scene(town.positions + np.float32(2.0**20), town.triangles)
    eye = np.array([-2.0, 2.0, -40.0]) + 2.0**20
    assert_same(scene, Camera.look_at(eye, eye + np.array([0.1, 0, 1]), width=80, height=60))


def test_a_walk_with_moving_houses_draws_little_and_a_flight_everything_in_view() -> None:
    town = towns.town(24)
    rng = np.random.default_rng(5)
    walk, flight = [], []
    for frame in range(6):
        shift = rng.uniform(-1, 1, (24 * 24 + 1, 3)).astype(np.float32)
        shift[-1] = 0
        positions = town.positions.copy()
        positions[town.triangles.reshape(-1)] += np.repeat(shift[town.object_id], 3, axis=0) * 0.5
        scene = town.moved(positions)
        eye = np.array([-2.0, 1.7, -150.0 + 30 * frame])
        walk.append(assert_same(scene, Camera.look_at(eye, eye + np.array([0.02, 0, 1]), width=120, height=90)))
        high = np.array([-200.0, 120.0, -200.0 + 10 * frame])
        flight.append(assert_same(scene, Camera.look_at(high, (0, 0, 0), width=120, height=90)))
    assert max(walk) < 0.35 and min(flight) > 0.5


def test_what_stands_before_the_eye_hides_all_behind() -> None:
    rng = np.random.default_rng(2)
    crowd = soup(rng, 5000, 0.05, grid=False)
    wall = [(-9, -9, 7), (9, -9, 7), (9, 9, 7), (-9, 9, 7)]
    both = Scene(
        np.concatenate([crowd.positions, wall]),
        np.concatenate([crowd.triangles, np.array([(0, 1, 2), (0, 2, 3)]) + 15000]),
    )
    camera = Camera.look_at((0, 0, 9), (0, 0, 0), width=64, height=64)
    assert assert_same(both, camera) <= 2 * SIZE / len(both.triangles)
    behind = Camera.look_at((0, 0, -9), (0, 0, 0), width=64, height=64)
    assert assert_same(both, behind) > 0.5


def test_layers_and_holes() -> None:
    scene, camera = models.pavilion(), models.pavilion_camera(120, 90)
    assert_same(scene, camera, 4)
    culled = sample_layers(scene, camera)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("umbrae.sampling.cpu.view", lambda found, _, picture: view_of_all(found, picture))
        plain = sample_layers(scene, camera)
    assert len(culled) == len(plain) > 1
    for one, other in zip(culled, plain, strict=True):
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_pane_hides_nothing_where_its_texture_has_holes() -> None:
    rng = np.random.default_rng(4)
    crowd = soup(rng, 400, 0.5, grid=False)
    pane = [(-9, -9, 7), (9, -9, 7), (9, 9, 7), (-9, 9, 7)]
    clear = Material(base_color=(1, 1, 1, 0.0), alpha_mode="MASK")
    scene = Scene(
        np.concatenate([pane, crowd.positions]).astype(np.float32),
        np.concatenate([[(0, 1, 2), (0, 2, 3)], crowd.triangles + 4]),
        [clear, Material()],
        np.array([0, 0] + [1] * 400),
    )
    camera = Camera.look_at((0, 0, 9), (0, 0, 0), width=64, height=64)
    assert_same(scene, camera)
    assert seen(scene, camera, culling=True)[0].covered.any()


@pytest.mark.parametrize("count", [0, 1, SIZE, SIZE + 1])
def test_few_triangles(count: int) -> None:
    scene = soup(np.random.default_rng(count), count, 1.0, grid=False) if count else Scene(np.zeros((0, 3)), [])
    camera = Camera.look_at((0, 0, 9), (0, 0, 0), width=20, height=20)
    one, other = (seen(scene, camera, culling)[0] for culling in (True, False))
    np.testing.assert_array_equal(one.triangle, other.triangle)


def test_triangles_in_no_order_are_grouped_along_a_curve_and_others_left_as_they_are() -> None:
    ball = models.spheres(triangles=20_000)
    assert (groups_of(ball).order == np.arange(len(ball.triangles))).all()
    mixed = Scene(ball.positions, np.random.default_rng(0).permutation(ball.triangles))
    order = groups_of(mixed).order
    assert (np.sort(order) == np.arange(len(order))).all() and (order != np.arange(len(order))).any()
    extents = [float((found.upper - found.lower).sum()) for found in (groups_of(ball), groups_of(mixed))]
    assert extents[1] < 2 * extents[0]
    assert groups_of(ball) is groups_of(ball)
