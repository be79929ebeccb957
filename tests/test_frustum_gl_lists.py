"""Shadow frusta on the GPU for samples that no camera sees as a picture: points, sensors, footprints."""

import dataclasses
import datetime as dt

import numpy as np
import pytest

from test_frustum_gl import light_over, picture_of, prepared, same_as_the_cpu
from umbrae import METHODS, Light, Scene, ViewSamples, models, shadow, sun_hours, verify
from umbrae.methods.area_average import average_over_light
from umbrae.methods.frustum_gl import layout
from umbrae.methods.frustum_gl.tiles import tiles_of_list
from umbrae.sampling.footprint import footprint

pytestmark = pytest.mark.usefixtures("opengl")


@pytest.fixture(scope="module")
def spheres():
    return models.spheres((4, 4), 3000)


@pytest.fixture(scope="module")
def pavilion():
    return models.pavilion().opaque()


@pytest.fixture(scope="module")
def places(pavilion):
    """Sensors on surfaces and free points, a tenth of both left out, in no order."""
    rng = np.random.default_rng(8)
    on = ViewSamples.on_surface(
        pavilion,
        rng.integers(0, len(pavilion.triangles), 900),
        rng.uniform(0, 0.5, (900, 2)),
        rng.choice([-1, 0, 1], 900),
    )
    low, high = pavilion.bounds.astype(float)
    free = ViewSamples.points(rng.uniform(low - 1, high + 1, (900, 3)))
    order = rng.permutation(1800)
    names = ("triangle", "barycentric", "side", "position", "covered")
    both = ViewSamples(*(np.concatenate([getattr(on, name), getattr(free, name)])[order] for name in names))
    return dataclasses.replace(both, covered=rng.random(1800) < 0.9)


def shaped(samples, *shape):
    return ViewSamples(
        *(
            values.reshape(*shape, *values.shape[1:])
            for values in (samples.triangle, samples.barycentric, samples.side, samples.position, samples.covered)
        )
    )


@pytest.mark.parametrize("light", [Light.point((0.2, 6.3, 0.4)), Light.directional((-0.4, -1.0, 0.3))])
def test_lists_of_any_shape(pavilion, places, light):
    whole = same_as_the_cpu(pavilion, light, places)
    assert 200 < whole.in_shadow.sum() < 1500 and not whole.in_shadow[~places.covered].any()
    assert verify(pavilion, light, places, whole).ok
    for shape in ((30, 60), (5, 18, 20), (2, 3, 3, 100), (1800, 1)):
        mask = prepared(pavilion).shadow(light, shaped(places, *shape))
        np.testing.assert_array_equal(mask.in_shadow, whole.in_shadow.reshape(shape))
    for count in (0, 1, 31, 32, 33, 1025):
        few = places.take(np.arange(count))
        np.testing.assert_array_equal(prepared(pavilion).shadow(light, few).in_shadow, whole.in_shadow[:count])


def test_parts_of_pictures_and_footprints(pavilion):
    samples, light = picture_of(pavilion, 60, 40), light_over(pavilion)
    whole = same_as_the_cpu(pavilion, light, samples).in_shadow
    np.testing.assert_array_equal(prepared(pavilion).shadow(light, samples.rows(7, 23)).in_shadow, whole[7:23])
    chosen = np.random.default_rng(2).permutation(samples.size)[:999]
    np.testing.assert_array_equal(
        prepared(pavilion).shadow(light, samples.take(chosen)).in_shadow, whole.reshape(-1)[chosen]
    )
    spread = footprint(pavilion, samples, 9, 3.0, (10, 30))
    assert (spread.covered & (spread.triangle < 0)).any(), "none of them is a free point"
    mask = same_as_the_cpu(pavilion, light, spread)
    assert mask.in_shadow.shape == (20, 60, 9) and 0.1 < mask.in_shadow.mean() < 0.9


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0.3)])
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_an_eye_sees_all_of_a_list(opengl, spheres, shape, scale):
    rng = np.random.default_rng(4)
    points = ViewSamples.points(3 + scale * np.array(shape) * rng.uniform(-1, 1, (500, 3)))
    made = prepared(spheres)
    uploads = made.upload(points)
    with opengl.current():
        places = made.passes.places(uploads.bands[0])[:500]
    at = places[:, :3].view(np.float32).astype(float)
    assert (places[:, 3].view(np.int32) == -2).all() and (np.abs(at[:, :2]) <= 1).all()
    # Back to space: in float32 not farther off than a few of its steps.
    unit = uploads.view.uniforms(made._reach)["unit"]
    w = unit / at[:, 2:]
    back = uploads.view.eye + np.concatenate([at[:, :2] * w, w], axis=1) @ np.linalg.inv(uploads.view.rows).T
    found = points.position.reshape(-1, 3)[uploads.bands[0].part.where]
    assert np.abs(back - found).max() <= 2.0**-20 * w.max()


def test_tiles_of_lists_are_32_samples_that_follow_each_other():
    tiles = tiles_of_list(100_000)
    assert tiles.levels[: tiles.depth + 1, :2].tolist() == [[100_000, 1], [3125, 1], [98, 1], [4, 1], [1, 1]]
    assert (tiles.depth, tiles.places, tiles.words) == (4, 100_000, 3125 + 98 + 4 + 1)
    assert tiles_of_list(1).depth == 1


def test_nodes_of_lists_are_accepted_as_a_whole():
    # A roof over a grid of points: all of them in its shadow, and hardly any of them tested.
    roof = Scene([(-9, 1, -9), (9, 1, -9), (0, 1, 9)], [(0, 1, 2)])
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 200), [0.0], np.linspace(-1, 1, 200)), axis=-1)
    mask = prepared(roof).shadow(Light.directional((0.01, -1, 0.02)), ViewSamples.points(grid))
    assert mask.in_shadow.shape == (1, 200, 200) and mask.in_shadow.all()
    assert mask.stats["sample_frustum_tests"] == 0 and mask.stats["tile_frustum_tests"] < 100


def test_lists_that_are_too_long_for_a_buffer_go_in_bands(monkeypatch, pavilion, places):
    light = Light.point((0.2, 6.3, 0.4))
    monkeypatch.setattr(layout, "BLOCK", 500)
    assert [band.part.samples.size for band in prepared(pavilion).upload(places).bands] == [480, 480, 480, 360]
    same_as_the_cpu(pavilion, light, places)


def test_points_far_away_from_the_scene(spheres):
    rng = np.random.default_rng(6)
    near = rng.uniform(*spheres.bounds.astype(float), (300, 3))
    points = ViewSamples.points(np.concatenate([near, 1e7 * rng.normal(size=(300, 3)), [[1e18, -1e18, 1e18]]]))
    for light in (light_over(spheres), Light.directional((1, -2, 1))):
        same_as_the_cpu(spheres, light, points)


def test_soft_light_and_hours_of_sun(pavilion, places):
    soft = Light.point((0.2, 6.3, 0.4), radius=0.3)
    few = places.take(np.arange(300))
    method = METHODS["frustum-gl"](light_samples=6)
    mask = shadow(pavilion, soft, few, method=method)
    truth = average_over_light(METHODS["frustum"]().prepare(pavilion), soft, few, 6)
    np.testing.assert_array_equal(mask.partial, truth.partial)
    assert ((mask.partial > 0) & (mask.partial < 1)).any()
    day = [dt.datetime(2024, 6, 21, hour, tzinfo=dt.UTC) for hour in (6, 9, 12, 15)]
    step = dt.timedelta(hours=3)
    studies = [sun_hours(pavilion, few, day, 48.2, 16.4, step=step, method=name) for name in ("frustum-gl", "frustum")]
    np.testing.assert_array_equal(studies[0].hours, studies[1].hours)
    assert 0 < np.nanmean(studies[0].hours) < np.nanmax(studies[0].hours)
