"""Culling of shadow volumes: it changes no verdict, and leaves out what cannot be seen."""

import numpy as np
import pytest

from test_volumes import VOLUMES
from towns import scene_of, town
from umbrae import METHODS, Camera, Light, Scene, sample
from umbrae.errors import OptionError
from umbrae.geometry.extruded_boxes import AROUND, INSIDE, OUTSIDE, place_boxes
from umbrae.methods.volumes import culling

pytestmark = pytest.mark.usefixtures("opengl")
EYE_LEVEL = 1.7


@pytest.fixture
def one_by_one(monkeypatch):
    """Each house by itself: scenes of a few hundred triangles are taken or left whole otherwise."""
    monkeypatch.setattr(culling, "FEW", 12)


def both(method, scene, **options):
    return [METHODS[method](culling=wanted, **options).prepare(scene) for wanted in (True, False)]


def same(casters, light, samples):
    """The counters of a mask that is the same with culling and without."""
    culled, whole = (caster.shadow(light, samples) for caster in casters)
    np.testing.assert_array_equal(culled.in_shadow, whole.in_shadow)
    assert "culled" not in whole.stats
    return culled.stats


def along_a_street(frame, width=72, height=48):
    """A way through the town that turns, meets a corner, and looks down from above."""
    eye = np.array([-2.0 + 14.0 * np.sin(frame / 6), EYE_LEVEL, -2.0 - 3.0 * frame])
    if frame == 5:
        eye[1] = 60.0
    ahead = np.array([np.sin(0.4 * frame), -0.8 if frame == 5 else 0.05, -np.cos(0.4 * frame)])
    return Camera.look_at(eye, eye + ahead, width=width, height=height, near=0.05)


def light_of(frame):
    """Two frames of sun each, then two of a lamp that moves."""
    if frame % 4 < 2:
        return Light.sun(40.0 + 9 * frame, 25.0 + 4 * frame)
    return Light.point((-2.0 + frame, 9.0 + 3 * frame, -8.0 - 5 * frame))


@pytest.mark.parametrize("counter", ["float", "stencil"])
@pytest.mark.parametrize("counting", ["auto", "zfail"])
@pytest.mark.parametrize("method", VOLUMES)
def test_a_fly_through_is_the_same_in_every_frame(method, counting, counter, one_by_one):
    scene = town(6)
    casters = both(method, scene, counting=counting, counter=counter)
    culled, seen = [], 0
    for frame in range(8):
        samples = sample(scene, along_a_street(frame))
        stats = same(casters, light_of(frame), samples)
        culled.append(stats["culled"])
        seen += stats["queries"]
    assert max(culled) > 200 and len(set(culled)) > 3, "of 434"
    assert seen > 50


@pytest.mark.parametrize("method", ["silhouette-cpu", "robust-gs"])
def test_houses_that_move(method, one_by_one):
    rng = np.random.default_rng(7)
    lower = rng.uniform(-30, 30, (60, 3)) * (1, 0, 1)
    size = rng.uniform(2, 6, (60, 3))
    culled = 0
    for frame in range(5):
        moved = lower + (0, 2 + 2 * np.sin(frame), 0) + frame * rng.normal(0, 0.3, (60, 3))
        scene = scene_of(moved, moved + size)
        samples = sample(scene, Camera.look_at((0, 1, 40), (3 * frame, 2, 0), width=72, height=48))
        culled += same(both(method, scene), light_of(frame), samples)["culled"]
    assert culled > 0


WALL = [((-40, 0, -1), (40, 40, -0.5))]
BEHIND_IT = [((3 * k - 15, 0, -20 - k), (3 * k - 13, 5, -18 - k)) for k in range(10)]
BEHIND_THE_EYE = [((3 * k, 0, 30), (3 * k + 2, 5, 32)) for k in range(3)]
BEFORE_THE_WALL = Camera.look_at((0, 2, 10), (0, 2, 0), width=48, height=32)
FROM_BEHIND = (Light.directional((-0.1, -1.0, -0.3)), Light.point((1.0, 60.0, 25.0)))
"""Lights behind the eye: houses there throw their shadows backwards, or not far enough."""


@pytest.mark.parametrize("method", VOLUMES)
def test_what_a_wall_hides_and_what_is_out_of_view_is_left_out(method, one_by_one):
    lower, upper = np.array(WALL + BEHIND_IT + BEHIND_THE_EYE).swapaxes(0, 1)
    scene = scene_of(lower, upper)
    casters, samples = both(method, scene), sample(scene, BEFORE_THE_WALL)
    for light in FROM_BEHIND:
        assert same(casters, light, samples)["culled"] == 12 * (10 + 3)


@pytest.mark.parametrize("method", ["silhouette-gs"])
def test_a_shadow_in_view_keeps_a_house_that_is_not(method, one_by_one):
    lower, upper = np.array(WALL + BEHIND_IT + BEHIND_THE_EYE).swapaxes(0, 1)
    scene = scene_of(lower, upper)
    samples = sample(scene, BEFORE_THE_WALL)
    low = Light.directional((0.01, -1.0, -8.0))  # shadows of those behind the eye reach the wall
    stats = same(both(method, scene), low, samples)
    assert stats["culled"] == 12 * 10


def test_a_jump_of_the_camera_shows_nothing_old(one_by_one):
    """Each frame, compared in its turn, hides what was seen in the one before."""
    scene = town(6)
    casters = both("silhouette-cpu", scene)
    light = Light.sun(130, 35)
    places = [along_a_street(frame) for frame in (0, 7, 2, 5, 1)]
    for camera in [*places, *places[::-1]]:
        same(casters, light, sample(scene, camera))


def test_what_the_last_frame_tells_is_not_asked_again(one_by_one):
    scene = town(16)
    caster = METHODS["silhouette-cpu"]().prepare(scene)
    light = Light.sun(130, 35)
    samples = sample(scene, Camera.look_at((40, 150, 260), (20, 0, 0), width=96, height=64))
    first, *later = [caster.shadow(light, samples).stats for _ in range(12)]
    assert all(stats["culled"] == first["culled"] for stats in later)
    assert 0 < np.mean([stats["queries"] for stats in later]) < 0.3 * first["queries"]
    # Another light knows nothing of this one, and this one is not forgotten.
    other = Light.point((0, 200, 0))
    caster.shadow(other, samples)
    assert caster.shadow(light, samples).stats["queries"] < 0.3 * first["queries"]


@pytest.mark.parametrize("counting", ["auto", "zfail"])
@pytest.mark.parametrize("method", VOLUMES)
def test_edges_between_what_is_kept_and_what_is_not(method, counting, monkeypatch):
    """Houses of which single triangles are left out."""
    monkeypatch.setattr(culling, "FEW", 1)
    scene = town(4, seed=3)
    casters = both(method, scene, counting=counting)
    partly = 0
    for frame in range(6):
        same(casters, light_of(frame), sample(scene, along_a_street(frame)))
        kept = casters[0].kept
        if kept is not None:
            houses = np.bincount(scene.object_id, kept)[:-1]
            partly += np.count_nonzero((houses > 0) & (houses < 12))
    assert partly > 20


@pytest.mark.parametrize("method", ["silhouette-cpu", "silhouette-gs"])
def test_samples_in_a_pixel_that_see_different_things(method, one_by_one):
    scene = town(6)
    casters = both(method, scene)
    for frame in range(12):
        samples = sample(scene, along_a_street(frame, 12, 8), samples_per_pixel=5)
        assert same(casters, light_of(frame), samples)["culled"] > 0


def test_a_mesh_of_one_object_is_cut(one_by_one):
    houses = town(8)
    scene = Scene(houses.positions, houses.triangles)
    casters = both("silhouette-cpu", scene)
    assert same(casters, Light.sun(130, 35), sample(scene, along_a_street(0)))["culled"] > 300


@pytest.mark.parametrize("method", VOLUMES)
@pytest.mark.parametrize("what", ["a giant around everything", "a lamp in every box", "the eye in every box"])
def test_nothing_to_be_gained(method, what, one_by_one):
    rng = np.random.default_rng(3)
    lower = rng.uniform(-3, -1, (40, 3))
    upper = -lower + rng.uniform(0, 1, (40, 3))
    scene = scene_of(lower, upper, ground=-9.0)
    if what == "a giant around everything":
        houses = town(4)
        shell = scene_of(np.array([(-300, -1, -300)]), np.array([(300, 300, 300)]), ground=None)
        scene = Scene(
            np.concatenate([houses.positions, shell.positions]),
            np.concatenate([houses.triangles, shell.triangles + len(houses.positions)]),
            object_id=np.zeros(len(houses.triangles) + 12, int),
        )
    eye = (0.1, 0.2, 0.3) if what == "the eye in every box" else (20, 8, 2)
    samples = sample(scene, Camera.look_at(eye, (0, 0, 0), width=48, height=32))
    lamp = Light.point((0.31, 0.17, 0.23) if what == "a lamp in every box" else (3, 40, 7))
    casters = both(method, scene)
    for _ in range(2):
        stats = same(casters, lamp, samples)
    if what != "a giant around everything":
        assert stats["culled"] == 0


def test_many_tiny_objects():
    rng = np.random.default_rng(5)
    lower = rng.uniform(-50, 50, (3000, 3)) * (1, 0.1, 1)
    scene = scene_of(lower, lower + rng.uniform(0.02, 0.1, (3000, 3)), ground=-6.0)
    casters = both("silhouette-gs", scene)
    samples = sample(scene, Camera.look_at((40, -2, 40), (48, -4, 41), width=72, height=48))
    assert same(casters, Light.point((0, 90, 0)), samples)["culled"] > 0.8 * 36000


def test_scenes_without_casters_or_without_anything_in_view():
    nothing = Scene(np.zeros((0, 3)), np.zeros((0, 3), int))
    flat = Scene([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
    away = town(3)
    for scene in (nothing, flat, away):
        camera = Camera.look_at((0, 90, 0), (0, 180, 1), width=24, height=16)
        samples = sample(scene, camera)
        assert not samples.covered.any()
        for name in ("silhouette-cpu", "robust-gs"):
            same(both(name, scene), Light.sun(100, 30), samples)


def test_boxes_whose_faces_coincide_with_what_is_seen(one_by_one):
    """Houses whose shadows begin in the very plane of the ground, of walls and of each other, from many sides."""
    rng = np.random.default_rng(11)
    cells = np.array([(x, 0, z) for x in range(-4, 4) for z in range(-4, 4) if rng.random() < 0.6])
    scene = scene_of(
        cells, cells + np.stack([np.ones(len(cells)), rng.integers(1, 4, len(cells)), np.ones(len(cells))], 1)
    )
    casters = both("silhouette-cpu", scene)
    culled = 0
    for _ in range(40):
        eye = rng.uniform(-6, 6, 3) * (1, 0, 1) + (0, rng.integers(1, 5), 0)
        samples = sample(scene, Camera.look_at(eye, rng.uniform(-4, 4, 3) * (1, 0.2, 1), width=48, height=32))
        light = Light.directional((rng.integers(-1, 2), -rng.integers(2, 6) / 2, 0))  # in the planes of walls
        culled += same(casters, light, samples)["culled"]
    assert culled > 5000


def test_options_that_are_not_true_or_false_are_refused():
    with pytest.raises(OptionError, match="silhouette-ts: culling: wanted True or False, got 'yes'"):
        METHODS["silhouette-ts"](culling="yes")


@pytest.mark.parametrize("directional", [True, False])
@pytest.mark.parametrize("ends", [True, False])
def test_where_extruded_boxes_lie(directional, ends):
    """Against points strewn over the boxes and their shadows."""
    rng = np.random.default_rng(13)
    camera = Camera.look_at((0, 0, 20), (1, 2, 0), fov_y=40, width=64, height=48)
    lower = rng.uniform(-40, 40, (400, 3)).astype(np.float32)
    upper = lower + rng.uniform(0, 9, (400, 3)).astype(np.float32)
    # Ending in a plane below everything that all light travels towards.
    light = np.array([2.0, 100.0, 9.0, 0.0 if directional else 1.0])
    plane = np.array([0.0, -1.0, 0.0, 60.0]) if ends else np.zeros(4)
    place, low, high = place_boxes(lower, upper, light, camera.eye, camera.world_to_clip, plane, 1e-3, (1e-3, 1e-9))
    assert (low < lower).all() and (high > upper).all()
    inside = lower[:, None] + rng.uniform(0, 1, (400, 500, 3)) * (upper - lower)[:, None]
    away = light[3] * inside - light[:3]
    reach = (
        (60.0 + inside[..., 1]) / -away[..., 1]
        if ends
        else rng.exponential(3.0, inside.shape[:2]) * (1 + 99 * directional)
    )
    points = inside + (rng.uniform(0, 1, reach.shape) * reach)[..., None] * away
    clip = points @ camera.world_to_clip[:, :3].T + camera.world_to_clip[:, 3]
    seen = ((np.abs(clip[..., :2]) <= clip[..., 2:]).all(axis=-1)).any(axis=1)
    assert not (seen & (place == OUTSIDE)).any()
    assert (place == OUTSIDE).sum() > 100 and (seen & (place == INSIDE)).sum() > 20
    # From the eye towards the light: does it meet the box?
    share = np.linspace(0, 1, 2001)[:, None]
    way = camera.eye + share * (light[:3] * 2 if directional else light[:3] - camera.eye)
    met = ((way[None] >= lower[:, None]) & (way[None] <= upper[:, None])).all(axis=-1).any(axis=1)
    np.testing.assert_array_equal(place[met], AROUND)
    assert met.sum() > 0 and (place == AROUND).sum() <= met.sum() + 3
