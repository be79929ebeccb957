"""One view sample per pixel, and shadows with smooth edges all the same."""

import dataclasses

import numpy as np
import pytest

import umbrae as um
from umbrae import models
from umbrae.antialiasing import filtered_shadow
from umbrae.camera import pixel_offsets
from umbrae.methods import make_method
from umbrae.samples import surface_points
from umbrae.sampling.footprint import LIFT_PX, footprint

SIZE = 32


def floor_and_blocker(edge: float) -> um.Scene:
    """A floor seen from straight above, and beyond the eye a sheet that ends at x = `edge`."""
    corners = [(-9, 0, -9), (9, 0, -9), (9, 0, 9), (-9, 0, 9)]
    sheet = [(-9, 40, -9), (edge, 40, -9), (edge, 40, 9), (-9, 40, 9)]
    return um.Scene(corners + sheet, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])


def from_above(size: int = SIZE) -> um.Camera:
    """Pixels on the floor are 1/8 of a world unit wide."""
    fov = 2 * np.degrees(np.arctan(size / 16 / 10))
    return um.Camera.look_at((0, 10, 0), (0, 0, 0), up=(0, 0, -1), fov_y=fov, width=size, height=size)


DOWN = um.Light.directional((0, -1, 0))


@pytest.mark.parametrize("width", [1.0, 3.0])
def test_a_straight_edge_covers_its_share_of_each_pixel(width):
    """The shadow ends at x = 0.03; pixel k spans (k - 16) / 8 to (k - 15) / 8."""
    edge = np.float32(0.03)
    scene = floor_and_blocker(float(edge))
    samples = um.sample(scene, from_above())
    assert (samples.triangle < 2).all()
    method = make_method("frustum")
    caster = method.prepare(scene)
    mask = filtered_shadow(method, caster, DOWN, samples, 64, width)
    middle = (np.arange(SIZE) - 15.5) / 8
    dark = np.clip((float(edge) - middle) / (width / 8) + 0.5, 0, 1)
    # 64 points of an R2 sequence: the share on one side of a line is off by a few points.
    assert np.abs(1 - mask.transmittance[..., 0] - dark[None, :]).max() <= 4 / 64
    assert mask.guarantee is um.Guarantee.NONE
    np.testing.assert_array_equal(mask.in_shadow, (mask.partial == 0).all(axis=-1))


def test_points_on_the_triangle_are_exact_and_those_beside_it_a_quarter_of_a_pixel_above():
    scene = floor_and_blocker(0.0)
    samples = um.sample(scene, from_above())
    spread = footprint(scene, samples, 16)
    assert spread.shape == (SIZE, SIZE, 16)
    own = spread.triangle >= 0
    assert own.any() and not own.all(), "the diagonal of the floor crosses pixels"
    np.testing.assert_array_equal(spread.triangle[own], np.broadcast_to(samples.triangle[..., None], own.shape)[own])
    uv = spread.barycentric[own].astype(np.float64)
    assert (uv >= 0).all() and (uv.sum(axis=-1) <= 1).all()
    points = surface_points(scene, spread.triangle[own], spread.barycentric[own])
    np.testing.assert_array_equal(points.astype(np.float32), spread.position[own])
    np.testing.assert_allclose(spread.position[~own][:, 1], LIFT_PX / 8, rtol=1e-5)
    # Where the footprint's points lie in the picture.
    across, _ = pixel_offsets(16)
    x = (np.arange(SIZE)[:, None] + across - SIZE / 2) / 8
    assert np.abs(spread.position[..., 0] - x[None]).max() <= 2e-3  # a lifted point moves in perspective


def test_rows_are_those_of_the_whole_picture():
    scene = models.pavilion().opaque()
    samples = um.sample(scene, models.pavilion_camera(64, 36))
    whole, part = footprint(scene, samples, 4), footprint(scene, samples, 4, rows=(10, 23))
    for name in ("triangle", "barycentric", "side", "position", "covered"):
        np.testing.assert_array_equal(getattr(whole, name)[10:23], getattr(part, name))


def test_it_comes_nearer_to_256_samples_per_pixel_than_one_does_and_every_verdict_is_exact():
    scene, light = models.pavilion().opaque(), models.pavilion_light()
    camera = models.pavilion_camera(160, 90)
    samples = um.sample(scene, camera)
    method = make_method("frustum")
    caster = method.prepare(scene)
    many = um.sample(scene, camera, 256)
    truth = 1 - caster.shadow(light, many).in_shadow.mean(axis=-1)
    hard = 1.0 - caster.shadow(light, samples).in_shadow
    smooth = filtered_shadow(method, caster, light, samples).partial[..., 0]
    floor = (many.covered & (many.position[..., 1] == 0)).all(axis=-1)  # no outline within the pixel
    assert floor.sum() > 500
    error = {"hard": np.abs(hard - truth)[floor].mean(), "smooth": np.abs(smooth - truth)[floor].mean()}
    assert error["smooth"] < 0.2 * error["hard"], error
    spread = footprint(scene, samples, 8)
    assert um.verify(scene, light, spread, caster.shadow(light, spread), count=5000).mismatches == 0


def test_a_lit_ball_has_no_shadow_on_its_lit_side_and_none_is_lit_on_its_dark_side():
    scene = models.sphere(12, 24)
    samples = um.sample(scene, um.Camera.look_at((0, 1, 5), (0, 0, 0), fov_y=30, width=48, height=48))
    light = um.Light.point((3, 6, 4))
    method = make_method("frustum")
    caster = method.prepare(scene)
    hard = caster.shadow(light, samples)
    mask = filtered_shadow(method, caster, light, samples)
    np.testing.assert_array_equal(mask.transmittance[..., 0], 1.0 - hard.in_shadow)


def test_what_cannot_be_spread_is_refused():
    scene = floor_and_blocker(0.0)
    samples = um.sample(scene, from_above(8))
    method = make_method("frustum")
    caster = method.prepare(scene)
    for other in (
        um.ViewSamples.points([(0, 1, 0)]),
        um.sample(scene, from_above(8), 2),
        samples.rows(1, 3),
        dataclasses.replace(samples, camera=None),
    ):
        with pytest.raises(um.InputError, match="footprint: wanted samples of a picture with one sample per pixel"):
            footprint(scene, other)
    for options, message in (((0, 1.0), "a count of at least 1, got 0"), ((4, 0.0), "a width > 0 in pixels, got 0.0")):
        with pytest.raises(um.OptionError, match=message):
            filtered_shadow(method, caster, DOWN, samples, *options)


def test_render_filters_or_says_why_not():
    scene, camera = floor_and_blocker(0.03), from_above(8)
    picture = um.render(scene, camera, DOWN, antialiasing="derivative", filter_width=3.0)
    partial = picture.masks[0].partial
    assert partial is not None and ((partial > 0) & (partial < 1)).any()
    for options, message in (
        ({"antialiasing": "msaa"}, "antialiasing: wanted one of samples, derivative, got 'msaa'"),
        ({"antialiasing": "derivative", "samples_per_pixel": 4}, "takes one sample per pixel, got 4"),
        ({"antialiasing": "derivative", "method": "silhouette-ts"}, "silhouette-ts takes whole pictures only"),
    ):
        with pytest.raises(um.OptionError, match=message):
            um.render(scene, camera, DOWN, **options)
