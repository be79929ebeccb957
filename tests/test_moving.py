"""Scenes that move: a caster that follows says what one says that was prepared for the moved scene."""

import numpy as np
import pytest
from numpy.typing import NDArray

from soups import SOUPS, TRANSPARENT
from test_contract import image_samples, lights_of, quick, takes
from umbrae import METHODS, Camera, InputError, Light, Scene, ViewSamples, models, render, sample
from umbrae.geometry.edges import still_welded, weld
from umbrae.transmission import transmission_of

MOVING = ["cube", "shared_edge", "tilted_grid", "wall_on_ground", "open_fan", *sorted(TRANSPARENT)[:2]]
FLAT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def apart(scene: Scene) -> Scene:
    """The same soup with three vertices of its own for each triangle."""
    corners = scene.triangles.reshape(-1)
    rows = [None if rows is None else rows[corners] for rows in (scene.uv, scene.colors)]
    alone = np.arange(len(corners)).reshape(-1, 3)
    return Scene(scene.positions[corners], alone, scene.materials, scene.material_id, uv=rows[0], colors=rows[1])


def afresh(scene: Scene) -> Scene:
    """The same scene, as if it had never been moved."""
    return Scene(
        scene.positions, scene.triangles, scene.materials, scene.material_id, scene.normals, scene.uv,
        scene.object_id, scene.colors, scene.origin,
    )  # fmt: skip


def frames_of(positions: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """Where vertices go; the same places go to the same places, but for those that part."""
    rng = np.random.default_rng(7)
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) * 1.5
    points = positions.astype(np.float64)
    frames = {
        "turned": points @ turn,
        "bent": points + 0.2 * np.sin(points[:, [1, 2, 0]]),
        "met": np.round(points @ FLAT / 2) * 2,
        "parted": points + rng.uniform(-0.2, 0.2, points.shape),
        "back": points,
    }
    return {name: there.astype(np.float32) for name, there in frames.items()}


def test_frames_keep_welds_and_break_them():
    positions = apart(SOUPS["wall_on_ground"].scene).positions
    welded, frames = weld(positions), frames_of(positions)
    assert {name: still_welded(welded, there) for name, there in frames.items()} == {
        "turned": True, "bent": True, "met": False, "parted": False, "back": True,
    }  # fmt: skip


def test_welds_do_not_depend_on_the_sign_of_zero():
    positions = np.array([[0, 1, 0], [0, 1, -0.0], [0, 0, 1]], np.float32)
    welded = weld(positions)
    assert welded.tolist() == [1, 1, 0]
    assert still_welded(welded, positions * np.float32(-1))
    assert not still_welded(welded, np.array([[0, 1, 0], [-0.0, 1, 0], [0.0, 1, -0.0]], np.float32))


@pytest.mark.parametrize(("method", "name"), [(m, name) for m in METHODS for name in MOVING if takes(m, name)])
def test_a_caster_that_follows_is_one_prepared_anew(method, name):
    soup = SOUPS[name]
    start = apart(soup.scene)
    caster = quick(method).prepare(start)
    for frame, positions in frames_of(start.positions).items():
        scene = caster.update(positions)
        assert caster.scene is scene
        np.testing.assert_array_equal(scene.positions, positions)
        samples, fresh = image_samples(scene, soup), quick(method).prepare(afresh(scene))
        for kind, light in lights_of(soup).items():
            mask, anew = caster.shadow(light, samples), fresh.shadow(light, samples)
            np.testing.assert_array_equal(mask.transmittance, anew.transmittance, f"{frame}, {kind}")
            assert mask.guarantee is anew.guarantee


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("smooth", {}),
        ("smooth-gl", {}),
        ("robust-gs", {}),
        ("frustum", {"front_face_culling": True}),
        ("frustum-gl", {"front_face_culling": True}),
        ("oracle", {"tree": False}),
    ],
)
def test_normals_and_solids_follow(method, options):
    scene = models.spheres(grid=(2, 2), triangles=300)
    assert scene.normals is not None
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.float32)
    caster = METHODS[method](**options).prepare(scene)
    dark = 0
    inside_out = scene.positions * np.float32(-1) + np.float32(0.1) * np.sin(scene.positions)
    for positions, normals in ((scene.positions @ turn * np.float32(3), scene.normals @ turn), (inside_out, None)):
        moved = caster.update(positions, normals)
        camera = Camera.frame(moved, width=48, height=32)
        samples, fresh = sample(moved, camera), METHODS[method](**options).prepare(afresh(moved))
        for light in (Light.directional(camera.axes[0] + camera.axes[2]), Light.directional((-0.3, -1.0, -0.2))):
            mask, anew = caster.shadow(light, samples), fresh.shadow(light, samples)
            np.testing.assert_array_equal(mask.in_shadow, anew.in_shadow)
            dark += int(anew.in_shadow.sum())
    assert dark > 100


@pytest.mark.parametrize(
    ("method", "options"),
    [("robust-gs", {}), ("frustum", {"front_face_culling": True}), ("frustum-gl", {"front_face_culling": True})],
)
def test_a_solid_that_is_turned_inside_out_is_none(method, options):
    cube = SOUPS["cube"].scene
    low, high = cube.bounds.astype(np.float64)
    middle, half = (low + high) / 2, (high - low) / 2
    inside = middle + half * [[-0.5, -0.5, 0.5], [0.5, -0.5, 0.5], [0.5, -0.5, -0.5], [-0.5, -0.5, -0.5]]
    count = len(cube.positions)
    scene = Scene(
        np.concatenate([cube.positions, inside]),
        [*cube.triangles.tolist(), [count, count + 1, count + 2], [count, count + 2, count + 3]],
    )
    caster = METHODS[method](**options).prepare(scene)
    turned = scene.positions.copy()
    turned[:count, 1] = low[1] + high[1] - turned[:count, 1]
    moved = caster.update(turned)
    # What stands in the cube sees its lid from the wrong side, which must shade it all the same.
    camera = Camera.look_at(middle + half * [0, 0.5, 0.1], middle - half * [0, 0.5, 0], width=32, height=24, near=0.01)
    samples, light = sample(moved, camera), Light.directional((0.1, -1.0, 0.2))
    on_floor = samples.triangle >= len(cube.triangles)
    assert on_floor.sum() > 50
    assert caster.shadow(light, samples).in_shadow[on_floor].all()


@pytest.mark.parametrize("positions", [None, "no numbers", [(0, 0, 0)], 7])
def test_positions_that_are_none_leave_the_caster_as_it_was(positions):
    scene = SOUPS["cube"].scene
    caster = METHODS["frustum"]().prepare(scene)
    with pytest.raises(InputError, match=r"Scene\.positions: wanted"):
        caster.update(positions)
    assert caster.scene is scene


def test_a_moved_scene_shares_all_but_its_vertices():
    scene = SOUPS[sorted(TRANSPARENT)[0]].scene
    assert scene.bounds.shape == (2, 3)
    moved = scene.moved(scene.positions + 1)
    assert moved.triangles is scene.triangles and moved.materials is scene.materials and moved.uv is scene.uv
    np.testing.assert_array_equal(moved.bounds, scene.bounds + 1)
    assert transmission_of(moved) is transmission_of(scene) is not None
    assert not moved.positions.flags.writeable


def test_a_moved_scene_is_checked():
    scene = SOUPS["cube"].scene
    wrong = scene.positions.copy()
    wrong[3, 1] = np.nan
    with pytest.raises(InputError, match=r"positions: row 3 is .*, wanted finite numbers"):
        scene.moved(wrong)
    with pytest.raises(InputError, match="positions: wanted 8 rows, one per vertex, got 7"):
        scene.moved(scene.positions[1:])
    with pytest.raises(InputError, match="normals: wanted 8 rows"):
        scene.moved(scene.positions, scene.positions[1:])


def test_scenes_far_from_zero_stay_where_they_are():
    scene = SOUPS["cube"].scene
    moved = scene.moved(scene.positions.astype(np.float64) + 12345.678)
    np.testing.assert_array_equal(moved.positions, (scene.positions + 12345.678).astype(np.float32))
    assert (moved.origin == scene.origin).all()


@pytest.mark.parametrize("method", list(METHODS))
def test_what_is_no_moved_copy_is_refused(method):
    soup = SOUPS["cube"]
    caster = METHODS[method]().prepare(soup.scene)
    before = image_samples(soup.scene, soup)
    with pytest.raises(InputError, match="wanted a moved copy of the caster's scene"):
        caster.follow(afresh(soup.scene))
    caster.update(soup.scene.positions + 5)
    with pytest.raises(InputError, match="another scene"):
        caster.shadow(Light.point((0, 9, 0)), before)


def test_samples_uploaded_before_are_refused(opengl):
    soup = SOUPS["cube"]
    caster = METHODS["frustum-gl"]().prepare(soup.scene)
    uploaded = caster.upload(ViewSamples.points([(0, 0, 0)]))
    caster.update(soup.scene.positions)
    with pytest.raises(InputError, match="uploaded before the scene was moved"):
        caster.shadow_on_gpu(Light.point((0, 9, 0)), uploaded)


def test_pictures_of_moved_scenes_show_them():
    scene = models.spheres(grid=(2, 2), triangles=300)
    camera = Camera.frame(scene, width=64, height=36)
    first = render(scene, camera).pixels
    moved = scene.moved(scene.positions * np.array([1, 0.5, 1]), scene.normals)
    np.testing.assert_array_equal(render(moved, camera).pixels, render(afresh(moved), camera).pixels)
    np.testing.assert_array_equal(render(scene, camera).pixels, first)
    assert (render(moved, camera).pixels != first).any()
