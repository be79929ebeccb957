"""Shadow maps: right far from edges, better with more texels, and wrong in the ways they are known for."""

import numpy as np
import pytest

import umbrae as um
from umbrae import GraphicsError, InputError, Light, Scene, ViewSamples
from umbrae.errors import OptionError
from umbrae.methods.shadow_map.method import ShadowMap

pytestmark = pytest.mark.usefixtures("opengl")

ROOF = [(-2.3, 3, 0.9), (0.9, 3, 2.3), (2.3, 3, -0.9), (-0.9, 3, -2.3)]
GROUND = [(-8, 0, 8), (8, 0, 8), (8, 0, -8), (-8, 0, -8)]
LIGHTS = {
    "sun": Light.directional((0.1, -1, 0.05)),
    "far": Light.point((1, 900, -2)),
    "before": Light.point((0.5, 14, 0.25)),
    "inside": Light.point((0.25, 5, 0.125)),
    "beside the roof": Light.point((2.5, 4, 0.5)),
}


@pytest.fixture(scope="module")
def roof() -> Scene:
    """A square three units above a larger one, turned so that its edges run askew to texels."""
    return Scene(GROUND + ROOF, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])


def on_ground(scene: Scene, count: int = 3000) -> ViewSamples:
    """Places on the ground, seen from above."""
    uv = np.random.default_rng(7).dirichlet((1, 1, 1), count)[:, :2]
    return ViewSamples.on_surface(scene, np.arange(count) % 2, uv, 1)


def wrong(mask: um.ShadowMask, truth: um.ShadowMask) -> float:
    """The share of samples that differ."""
    return float((mask.in_shadow != truth.in_shadow).mean())


@pytest.mark.parametrize(
    ("kind", "projection"), [*((kind, "auto") for kind in LIGHTS), ("before", "cube"), ("inside", "cube")]
)
def test_far_from_edges_a_map_is_right(roof, kind, projection):
    light, samples = LIGHTS[kind], on_ground(roof)
    truth = um.shadow(roof, light, samples, "oracle")
    mask = ShadowMap(size=512, projection=projection).prepare(roof).shadow(light, samples)
    assert mask.guarantee is um.Guarantee.NONE
    moved = samples.position[:, None] + 0.3 * np.array([[i, 0, j] for i in (-1, 0, 1) for j in (-1, 0, 1)], np.float32)
    around = um.shadow(roof, light, ViewSamples.points(moved + np.float32(1e-4) * np.eye(3)[1]), "oracle").in_shadow
    clear = around.all(axis=1) | ~around.any(axis=1)
    assert truth.in_shadow[clear].any() and not truth.in_shadow[clear].all() and clear.mean() > 0.5
    np.testing.assert_array_equal(mask.in_shadow[clear], truth.in_shadow[clear])


@pytest.mark.parametrize(("kind", "maps"), [("sun", 1), ("far", 1), ("before", 1), ("inside", 6)])
def test_a_light_gets_one_map_where_one_will_do(roof, kind, maps):
    stats = ShadowMap(size=64).prepare(roof).shadow(LIGHTS[kind], on_ground(roof, 8)).stats
    side = 64 if maps == 1 else 32
    assert stats == {"maps": maps, "texels_per_side": side, "map_bytes": 4 * side * side}


def test_more_texels_are_wrong_less_often(roof):
    samples = on_ground(roof, 100_000)
    for light in LIGHTS.values():
        truth = um.shadow(roof, light, samples)
        found = [wrong(ShadowMap(size=size).prepare(roof).shadow(light, samples), truth) for size in (16, 64, 256)]
        assert found[0] > 2 * found[1] > 4 * found[2] and found[0] > 0.003, found


def test_without_bias_a_surface_shadows_itself(roof):
    light, samples = Light.directional((0.6, -1, 0.45)), on_ground(roof)
    truth = um.shadow(roof, light, samples, "oracle")
    bare = ShadowMap(size=128, bias=0, slope_bias=0).prepare(roof).shadow(light, samples).in_shadow
    biased = ShadowMap(size=128).prepare(roof).shadow(light, samples).in_shadow
    assert (bare & ~truth.in_shadow).mean() > 0.2, "acne"
    assert (biased & ~truth.in_shadow).mean() < 0.02


def test_with_too_much_bias_shadows_come_off(roof):
    """The roof is 3 units above the ground, 3/16 of the extent: a bias beyond that sees through it."""
    light, samples = LIGHTS["sun"], on_ground(roof)
    truth = um.shadow(roof, light, samples, "oracle").in_shadow
    some, too_much = (
        ShadowMap(size=256, bias=bias).prepare(roof).shadow(light, samples).in_shadow for bias in (0.15, 0.25)
    )
    assert truth.mean() > 0.04 and (some & truth).sum() > 0.9 * truth.sum() and not too_much.any()


def test_a_filter_makes_steps_of_grey_across_edges(roof):
    light, samples = LIGHTS["sun"], on_ground(roof)
    truth = um.shadow(roof, light, samples, "oracle")
    mask = ShadowMap(size=128, filter=3).prepare(roof).shadow(light, samples)
    steps = mask.transmittance * 9
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-5)
    assert len(np.unique(np.round(steps))) > 5
    assert ((steps[:, 0] == 0) == mask.in_shadow).all()
    assert np.abs(mask.transmittance - truth.transmittance).mean() < 0.02


def test_a_filter_looks_beyond_the_face_of_a_cube():
    """The roof's edge is seen at 45 degrees, where two faces meet: half of the texels around it are lit."""
    ground = [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]
    scene = Scene(
        [*ground, (-1, 3, 1), (2, 3, 1), (2, 3, -1), (-1, 3, -1)], [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    )
    x = np.array([3.0, 4.2, 4.95, 4.999, 5.001, 5.05, 5.8, 7.0])
    uv = np.stack([x / 18 + 0.5, np.full(len(x), 0.5 - 0.3 / 18)], axis=1)
    # Of the two triangles, the one that holds them: p = a + u (b - a) + v (c - a), with b - a along x.
    samples = ViewSamples.on_surface(scene, np.zeros(len(x), int), np.stack([uv[:, 0] - uv[:, 1], uv[:, 1]], axis=1), 1)
    np.testing.assert_allclose(samples.position[:, 0], x, atol=1e-5)
    method = ShadowMap(size=256, filter=8, projection="cube")
    share = method.prepare(scene).shadow(Light.point((0, 5, 0)), samples).transmittance[:, 0]
    assert share[:2].tolist() == [0.0, 0.0] and share[-2:].tolist() == [1.0, 1.0]
    assert (abs(share[2:6] - 0.5) < 0.2).all(), share
    # Where there is no filter, faces are not wider than they must be.
    bare = ShadowMap(size=256, projection="cube").prepare(scene).shadow(Light.point((0, 5, 0)), samples)
    assert bare.in_shadow.tolist() == [True] * 4 + [False] * 4


def test_samples_turned_away_are_dark_without_a_look(roof):
    under = ViewSamples.on_surface(roof, [0, 1, 2], [[0.25, 0.25]] * 3, -1)
    for light in LIGHTS.values():
        truth = um.shadow(roof, light, under, "oracle").in_shadow
        huge = ShadowMap(size=16, bias=10).prepare(roof).shadow(light, under).in_shadow
        np.testing.assert_array_equal(huge[:2], truth[:2])


def test_points_beyond_the_scene_are_in_its_shadow(roof):
    points = ViewSamples.points([(0, -500, 0), (0, -20, 0), (300, -500, 0), (0, 40, 0)])
    for size in (64, 512):
        mask = ShadowMap(size=size).prepare(roof).shadow(LIGHTS["before"], points)
        assert mask.in_shadow.tolist() == [True, True, False, False]


def test_a_scene_far_away_or_of_any_size_is_the_same(roof):
    samples = on_ground(roof)
    here = ShadowMap(size=128).prepare(roof).shadow(LIGHTS["before"], samples).in_shadow
    for scale, shift in ((2.0**-40, 0), (2.0**40, 0), (1, 4096)):
        moved = Scene(roof.positions * np.float32(scale) + np.float32(shift), roof.triangles)
        there = ViewSamples.on_surface(moved, samples.triangle, samples.barycentric, 1)
        light = Light.point(LIGHTS["before"].position[:3] * np.float32(scale) + np.float32(shift))
        assert (ShadowMap(size=128).prepare(moved).shadow(light, there).in_shadow != here).mean() < 0.005


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": 1}, "size: wanted at least 2 texels, got 1"),
        ({"size": 2.5}, "size: wanted a whole number, got 2.5"),
        ({"bias": -1}, "bias: wanted a number of at least 0, got -1"),
        ({"slope_bias": float("nan")}, "slope_bias: wanted a finite number, got nan"),
        ({"filter": 17}, "filter: wanted 1 to 16 texels, got 17"),
        ({"projection": "round"}, "projection: wanted one of auto, single, cube, got 'round'"),
    ],
)
def test_values_that_it_does_not_take_are_refused(options, message):
    with pytest.raises(InputError, match=f"shadow-map: {message}"):
        ShadowMap(**options)


def test_a_map_larger_than_the_driver_takes_is_refused(roof):
    with pytest.raises(
        GraphicsError, match=r"shadow-map: size: this OpenGL driver takes up to \d+ texels, got 1048576"
    ):
        ShadowMap(size=1 << 20).prepare(roof)


def test_a_single_map_refuses_a_light_that_it_cannot_serve(roof):
    with pytest.raises(OptionError, match="projection='single' cannot show the whole scene"):
        ShadowMap(size=64, projection="single").prepare(roof).shadow(LIGHTS["inside"], on_ground(roof))
