"""The main job, end to end."""

import numpy as np
import pytest

import umbrae.memory
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import CapacityError, InputError, OptionError
from umbrae.geometry.texture import SRGB_TO_LINEAR
from umbrae.light import Light
from umbrae.mask import Guarantee
from umbrae.material import Material
from umbrae.methods import METHODS
from umbrae.render import default_sun, render
from umbrae.sampling import sample, sample_layers, sample_stochastic
from umbrae.scene import Scene
from umbrae.shade import shade

SMALL = {"width": 64, "height": 40}


def floor_and_roof():
    """A roof over the middle of a floor, both level; the sun at the zenith draws the roof's shadow straight below."""
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    positions = np.concatenate([corners * 4, corners + np.array([0, 2, 0])])
    return Scene(positions, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])


def test_the_shadow_lies_below_the_roof():
    camera = Camera.look_at((0, 3, 9), (0, 0, 0), **SMALL)
    image = render(floor_and_roof(), camera, Light.directional((0, -1, 0)))
    place = image.samples.position
    on_floor = image.samples.covered & (image.samples.triangle < 2)
    below = (np.abs(place[..., 0]) < 0.999) & (np.abs(place[..., 2]) < 0.999)
    beside = (np.abs(place[..., 0]) > 1.001) | (np.abs(place[..., 2]) > 1.001)
    (mask,) = image.masks
    assert mask.guarantee is Guarantee.EXACT
    assert (on_floor & below).sum() > 20 and mask.in_shadow[on_floor & below].all()
    assert not mask.in_shadow[on_floor & beside].any()
    grey = image.pixels.astype(int).sum(axis=2)
    assert grey[on_floor & below].max() < grey[on_floor & beside].min()
    red, _, blue = image.pixels[on_floor & below].mean(axis=0)
    assert blue > red, "shadows are cool"


def test_defaults_make_a_picture_of_the_whole_scene():
    image = render(
        floor_and_roof(),
        method=METHODS["oracle"](),
        samples_per_pixel=1,
        camera=Camera.frame(floor_and_roof(), **SMALL),
    )
    assert image.pixels.shape == (40, 64, 3) and len(image.masks) == 1
    assert 0.2 < image.samples.covered.mean() < 0.9
    assert image.masks[0].in_shadow.any()


def test_frame_fills_the_picture():
    scene = floor_and_roof()
    for width, height, up in ((64, 40, (0, 1, 0)), (40, 64, (0, 0, 1)), (300, 20, (1, 1, 1))):
        camera = Camera.frame(scene, up, width=width, height=height)
        x, y, w = camera.world_to_clip @ np.column_stack([scene.positions, np.ones(8)]).T
        assert (w > camera.near).all()
        low, high = np.array([(x / w).min(), (y / w).min()]), np.array([(x / w).max(), (y / w).max()])
        assert low.min() >= -1 and high.max() <= 1
        assert max(high - low) > 1.8, "one direction is filled"
        np.testing.assert_allclose(low + high, 0, atol=0.02, err_msg="and the other is centred")


def test_the_default_sun_shines_over_the_left_shoulder():
    for up in ((0, 1, 0), (0, 0, 1), (1, 1, 0)):
        camera = Camera.look_at((3, 4, 5), (0, 0, 0.5), up=up)
        sun = default_sun(camera, up)
        right, _, forward = camera.axes @ sun.position[:3]
        assert right < -0.3 and forward < -0.3
        assert sun.position[:3] @ np.array(up) / np.linalg.norm(up) == pytest.approx(np.sin(np.radians(40)), abs=1e-6)
    down = default_sun(Camera.look_at((0, 5, 0), (0, 0, 0)))
    assert np.isfinite(down.position).all() and down.position[1] > 0.6


def test_each_stage_is_a_span_and_each_light_a_shadow():
    clock = Clock()
    camera = Camera.frame(floor_and_roof(), **SMALL)
    image = render(floor_and_roof(), camera, [Light.sun(10, 50), Light.point((0, 5, 0))], clock=clock)
    stages = [name for name, _ in clock.spans if name in ("sample", "prepare", "shadow", "shade")]
    assert stages == ["sample", "prepare", "shadow", "shadow", "shade"]
    assert len(image.masks) == 2 and (image.masks[0].in_shadow != image.masks[1].in_shadow).any()


def test_supersampling_smooths_edges():
    camera = Camera.look_at((0, 3, 9), (0, 0, 0), **SMALL)
    sun = Light.directional((0, -1, 0))
    one = render(floor_and_roof(), camera, sun).pixels
    four = render(floor_and_roof(), camera, sun, samples_per_pixel=4)
    assert four.samples.shape == (40, 64, 4) and four.masks[0].in_shadow.shape == (40, 64, 4)
    partly = four.masks[0].in_shadow.any(axis=2) & ~four.masks[0].in_shadow.all(axis=2)
    inside = four.samples.covered.all(axis=2) & (np.ptp(four.samples.triangle // 2, axis=2) == 0)
    assert (partly & inside).sum() > 5
    flat = ~partly & inside
    assert np.abs(one.astype(int) - four.pixels)[flat].max() <= 2
    row = np.flatnonzero((partly & inside).any(axis=1))[0]
    column = np.flatnonzero((partly & inside)[row])[0]
    palette = np.unique(one.reshape(-1, 3)[:, 0])
    assert palette.min() < four.pixels[row, column, 0] < palette.max()


def test_an_empty_scene_is_sky_and_ground():
    image = render(Scene([], []), Camera.look_at((0, 0, 3), (0, 0, 0), **SMALL))
    assert not image.samples.covered.any() and not image.masks[0].in_shadow.any()
    assert len(np.unique(image.pixels[:, 0], axis=0)) > 5


def test_wrong_input_is_refused():
    scene, camera = floor_and_roof(), Camera.look_at((0, 3, 9), (0, 0, 0), **SMALL)
    with pytest.raises(InputError, match="at least one light"):
        render(scene, camera, [])
    with pytest.raises(InputError, match="wanted Light, got str"):
        render(scene, camera, ["sun"])
    with pytest.raises(InputError, match="wanted Light, got int"):
        render(scene, camera, 3)
    with pytest.raises(OptionError, match="did you mean 'frustum'"):
        render(scene, camera, method="frustrum")
    for wrong in (0, -1, 1.5, "4"):
        with pytest.raises(OptionError, match="samples_per_pixel"):
            render(scene, camera, samples_per_pixel=wrong)
    with pytest.raises(InputError, match="up: wanted a vector that is not zero"):
        Camera.frame(scene, up=(0, 0, 0))
    for wrong in ((0, 0, 0), (0, 1), (0, np.nan, 0)):
        with pytest.raises(InputError, match="up"):
            render(scene, camera, up=wrong)
        with pytest.raises(InputError, match="up"):
            render(scene, camera, Light.sun(0, 45), up=wrong)
    with pytest.raises(CapacityError, match="65536 x 65536"):
        render(scene, Camera.look_at((0, 3, 9), (0, 0, 0), width=65536, height=65536))


def test_the_number_of_threads_changes_nothing(monkeypatch):
    pictures = []
    for threads in ("1", "3"):
        monkeypatch.setenv("UMBRAE_THREADS", threads)
        pictures.append(render(floor_and_roof(), Camera.frame(floor_and_roof(), **SMALL)).pixels)
    np.testing.assert_array_equal(*pictures)


# Transparent surfaces


def pane_and_wall(pane):
    """A pane, half as wide as the view, before a wall that fills it."""
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    positions = np.concatenate([square + np.array((0, 0, 1)), square * 9])
    triangles = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    return Scene(positions, triangles, [pane, Material((0.4, 0.4, 0.4))], [0, 0, 1, 1])


FRONT = Camera.look_at((0, 0, 4), (0, 0, 0), fov_y=60, **SMALL)
FROM_THE_SIDE = Light.directional((-3, 0, -1), intensity=0.3)


def test_transparent_surfaces_are_seen_through_and_receive_shadows():
    scene = pane_and_wall(Material((0.1, 0.2, 0.3, 0.25), "BLEND"))
    clock = Clock()
    image = render(scene, FRONT, [FROM_THE_SIDE, Light.directional((0, 0, -1))], clock=clock)
    assert [name for name, _ in clock.spans].count("shadow") == 4
    expected = sample_layers(scene, FRONT)
    assert len(image.layers) == len(image.layer_masks) == 2
    for found, wanted in zip(image.layers, expected, strict=True):
        np.testing.assert_array_equal(found.triangle, wanted.triangle)
    assert image.samples is image.layers[0] and image.masks is image.layer_masks[0]
    assert image.behind == image.layers[1:] and image.masks_behind == image.layer_masks[1:]
    np.testing.assert_array_equal(
        image.pixels,
        shade(scene, FRONT, [FROM_THE_SIDE, Light.directional((0, 0, -1))], image.layers, image.layer_masks),
    )
    # Squarely behind the pane no light of the second kind arrives at the wall.
    inside = image.layers[1].covered & (np.abs(image.layers[1].position[..., :2]) < 0.99).all(axis=-1)
    assert inside.any() and image.layer_masks[1][1].transmittance[inside].max() < 1


def test_a_solid_scene_has_one_layer():
    image = render(floor_and_roof(), Camera.frame(floor_and_roof(), **SMALL))
    assert len(image.layers) == 1 and image.behind == () and image.masks_behind == ()


def test_a_single_layer_is_shown_as_if_solid():
    scene = pane_and_wall(Material((0.1, 0.2, 0.3, 0.25), "BLEND"))
    one = render(scene, FRONT, FROM_THE_SIDE, layers=1)
    np.testing.assert_array_equal(one.samples.triangle, sample(scene, FRONT).triangle)
    expected = shade(scene.opaque(), FRONT, [FROM_THE_SIDE], one.samples, one.masks)
    np.testing.assert_array_equal(one.pixels, expected)
    assert (render(scene, FRONT, FROM_THE_SIDE).pixels != one.pixels).any()


@pytest.mark.parametrize(
    "pane",
    [Material((0.1, 0.1, 0.1, 0.3), "BLEND"), Material((0.8, 0.4, 0.2), transmission=0.7)],
    ids=["grey", "glass"],
)
def test_layers_and_chance_make_the_same_picture_on_average(pane):
    scene = pane_and_wall(pane)
    layered = render(scene, FRONT, FROM_THE_SIDE, samples_per_pixel=8)
    chosen = render(scene, FRONT, FROM_THE_SIDE, samples_per_pixel=64, stochastic=7)
    assert len(layered.layers) == 2 and len(chosen.layers) == 1
    np.testing.assert_array_equal(chosen.samples.triangle, sample_stochastic(scene, FRONT, 64, 7).triangle)
    one, other = (SRGB_TO_LINEAR[image.pixels].astype(float) for image in (layered, chosen))
    np.testing.assert_allclose(one.mean(axis=(0, 1)), other.mean(axis=(0, 1)), rtol=0.004)
    inside = (np.abs(layered.samples.position[..., :2]) < 0.9).all(axis=(-1, -2)) & (layered.samples.triangle < 2).all(
        2
    )
    assert inside.sum() > 100
    np.testing.assert_allclose(one[inside].mean(axis=0), other[inside].mean(axis=0), rtol=0.01)
    # Of 64 samples 0.3 * 64 see the pane, or one more or less: little noise is left.
    assert np.abs(one[inside] - other[inside]).mean() < 0.02 * one[inside].mean()


def test_layers_are_asked_for_in_whole_numbers(monkeypatch):
    scene = pane_and_wall(Material((0.1, 0.2, 0.3, 0.25), "BLEND"))
    for wrong in (0, -2, 1.5, None):
        with pytest.raises(OptionError, match="layers: wanted a whole number from 1"):
            render(scene, FRONT, layers=wrong)
    with pytest.raises(OptionError, match="seed: wanted a whole number from 0"):
        render(scene, FRONT, stochastic=-1)
    sizes = iter([1 << 30] * 2)  # for the picture, another layer
    monkeypatch.setattr(umbrae.memory, "available_bytes", lambda: next(sizes, 1 << 16))
    with pytest.raises(CapacityError, match=r"the rest of a picture of 64 x 40 pixels in 2 layers \(fewer need less\)"):
        render(scene, FRONT)
