"""Casters that let light through, on the GPU: shares by the definition, and chances beside the CPU's."""

import dataclasses

import numpy as np
import pytest

from test_frustum_gl import light_over, picture_of, prepared
from umbrae import METHODS, Camera, Guarantee, Light, Scene, ViewSamples, models, sample, verify
from umbrae.geometry.predicates import hit_weights, shadows
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.material import Material
from umbrae.methods.area_average import average_over_light
from umbrae.methods.frustum_gl import caster as frames
from umbrae.methods.frustum_gl import layout
from umbrae.transmission import CLEAR, EVEN, SOLID, VARYING, passing, transmission_of

pytestmark = pytest.mark.usefixtures("opengl")


CHECKER = np.array([[[255, 255, 255, 255], [255, 0, 0, 0]], [[0, 255, 0, 128], [40, 80, 160, 255]]], np.uint8)
MATERIALS = {
    "solid": Material(),
    "glass": Material((0.9, 0.5, 0.1, 1.0), transmission=0.8),
    "red glass": Material((1.0, 0.0, 0.0, 1.0), transmission=1.0),
    "veil": Material((0.5, 0.5, 0.5, 0.3), alpha_mode="BLEND"),
    "air": Material((1.0, 1.0, 1.0, 0.0), alpha_mode="BLEND"),
    "leaf": Material(alpha_mode="MASK", texture=CHECKER),
    "printed": Material((1.0, 0.8, 0.6, 0.9), alpha_mode="BLEND", texture=CHECKER),
    "stained": Material((1.0, 0.9, 0.8, 1.0), transmission=0.7, texture=CHECKER),
    "film": Material(alpha_mode="MASK", transmission=0.5, texture=CHECKER),
}


def arriving(scene, light, samples):
    """The share of light that arrives at each sample, by the definition: every triangle is asked."""
    table, source = transmission_of(scene), light.position.astype(float)
    facing = facing_of_all(scene.positions, scene.triangles, light.position)
    share = np.ones((samples.size, 3))
    flat = samples.take(np.arange(samples.size))
    for s in np.flatnonzero(flat.covered):
        own, side, (u, v) = flat.triangle[s], int(flat.side[s]), flat.barycentric[s].astype(float)
        if side * facing[own] < 0:
            share[s] *= share_at(scene, table, own, (1 - u - v, u, v))
        for t in np.flatnonzero(facing):
            if t == own or table.kind[t] == CLEAR:
                continue
            closed = bool(table.kind[t] == SOLID or table.closed[scene.material_id[t]])
            point = np.empty(3)
            if shadows(scene.positions, scene.triangles, t, facing[t], source, own, u, v, side, point, closed) & 1:
                share[s] *= share_at(scene, table, t, hit_weights(scene.positions, scene.triangles, t, source, point))
    return share.reshape(*samples.shape, 3)


def share_at(scene, table, t, weights):
    if table.kind[t] == SOLID:
        return np.zeros(3)
    if table.kind[t] == EVEN:
        return table.even[table.material_id[t]]
    return np.array(passing(scene.triangles, table, t, *weights)) if table.kind[t] == VARYING else np.ones(3)


def mixed(seed, colors=False, count=36):
    """Triangles at random over a ground, of all kinds of materials."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.5, (count, 3, 3))
    ground = np.array([[-4, -2, -4], [4, -2, -4], [4, -2, 4], [-4, -2, 4]])
    positions = np.concatenate([corners.reshape(-1, 3), ground]).astype(np.float32)
    triangles = np.concatenate([np.arange(3 * count).reshape(-1, 3), 3 * count + np.array([[0, 2, 1], [0, 3, 2]])])
    return Scene(
        positions,
        triangles,
        list(MATERIALS.values()),
        np.append(rng.integers(0, len(MATERIALS), count), [0, 0]),
        uv=rng.uniform(-1, 2, (len(positions), 2)),
        colors=rng.uniform(0, 1, (len(positions), 4)) if colors else None,
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("colors", [False, True])
@pytest.mark.parametrize("skip_full", [False, True])
def test_shares_of_light_are_those_of_the_definition(seed, colors, skip_full):
    scene = mixed(seed, colors)
    camera = Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=44, height=30)
    samples = sample(scene, camera)
    for light in (Light.point((1, 5, 2)), Light.directional((0.2, -1, 0.1)), Light.point((0.1, 0.2, 0.0))):
        mask = prepared(scene, skip_full=skip_full).shadow(light, samples)
        truth = arriving(scene, light, samples)
        assert mask.partial.dtype == np.float32 and mask.tolerance <= 1e-4
        np.testing.assert_allclose(mask.partial, truth, rtol=0, atol=mask.tolerance)
        np.testing.assert_array_equal(mask.in_shadow, (truth == 0).all(axis=-1))
        assert (mask.partial[~samples.covered] == 1).all()
    lit = truth[samples.covered]
    assert ((lit > 0.01) & (lit < 0.99)).any() and (lit == 0).any()


def test_panes_count_once_along_their_edges(opengl):
    # A grid of quads of glass over a ground of quads, the light above: samples on the edges of both, to the last bit.
    steps = np.arange(-2, 3, dtype=np.float32)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    grid = np.stack([x, np.full_like(x, 1.0), z], axis=-1).reshape(-1, 3)
    at = np.arange(25).reshape(5, 5)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    pane = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)[:, ::-1]])
    ground = np.array([[-8, 0, -8], [8, 0, -8], [0, 0, 8]], np.float32)
    for material, through in (
        (MATERIALS["glass"], (0.72, 0.4, 0.08)),
        (MATERIALS["red glass"], (1.0, 0.0, 0.0)),
        (Material(alpha_mode="BLEND", base_color=(1, 1, 1, 0.5)), (0.5, 0.5, 0.5)),
    ):
        scene = Scene(
            np.concatenate([grid, ground]), np.concatenate([pane, [[25, 27, 26]]]), [material, Material()],
            [0] * len(pane) + [1],
        )  # fmt: skip
        # On the ground, at multiples of 1 / 8: barycentrics that are whole multiples of 2^-7.
        u, v = np.meshgrid(np.arange(40, 60) / 128, np.arange(40, 60) / 128)
        samples = ViewSamples.on_surface(scene, np.full(u.shape, len(pane)), np.stack([u, v], -1), 1)
        camera = Camera.look_at((0, 30, 0.1), (0, 0, 0), fov_y=40, width=20, height=20)
        depth = np.full(u.shape, 30, np.float32)
        samples = dataclasses.replace(samples, camera=camera, depth=depth)
        light = Light.directional((0, -1, 0))
        mask = prepared(scene).shadow(light, samples)
        truth = arriving(scene, light, samples)
        np.testing.assert_allclose(mask.partial, truth, rtol=0, atol=1e-6)
        below = (np.abs(samples.position[..., [0, 2]]) < 2).all(axis=-1)
        assert below.sum() > 50
        np.testing.assert_allclose(mask.partial[below], np.broadcast_to(through, (below.sum(), 3)), rtol=0, atol=1e-6)
        assert mask.stats["predicate_fallbacks"] > 10


def test_shares_do_not_depend_on_bands_batches_or_room(monkeypatch):
    scene, light = mixed(1, count=60), Light.point((1, 5, 2))
    samples = sample(scene, Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=300, height=150))
    whole = prepared(scene).shadow(light, samples)
    monkeypatch.setattr(layout, "BLOCK", 9000)
    monkeypatch.setattr(frames, "BATCH", 7)
    monkeypatch.setattr(frames, "ROOM", 2)
    parts = prepared(scene).shadow(light, samples)
    np.testing.assert_array_equal(parts.partial, whole.partial)
    np.testing.assert_array_equal(parts.in_shadow, whole.in_shadow)


def test_a_thousand_veils_are_a_product():
    # More than float32's or a sum's range: 1000 layers of 1 %, then of 50 %.
    count = 1000
    corners = np.array([[-3, 0, -3], [3, 0, -3], [0, 0, 5]], np.float32)
    heights = np.concatenate([[0.0], 1.0 + np.arange(count) / count]).astype(np.float32)
    positions = (corners + heights[:, None, None] * np.array([0, 1, 0], np.float32)).reshape(-1, 3)
    triangles = np.arange(len(positions)).reshape(-1, 3)[:, ::-1]
    ground = Scene(positions[:3], triangles[:1] % 3)
    samples = sample(ground, Camera.look_at((0, 0.5, -2), (0, 0, 0.5), width=30, height=20))
    for alpha in (0.01, 0.5):
        veil = Material((1, 1, 1, alpha), alpha_mode="BLEND")
        scene = Scene(positions, triangles, [Material(), veil], [0] + [1] * count)
        mask = prepared(scene).shadow(Light.directional((0, -1, 0)), samples)
        found = mask.partial[samples.covered]
        np.testing.assert_allclose(found, np.full(found.shape, (1 - alpha) ** count), rtol=0, atol=1e-5)
        assert not mask.in_shadow.any(), "hardly anything is not nothing"


def test_what_is_surely_inside_a_textured_caster_is_not_tested():
    corners = np.array([[-30, 0, -30], [30, 0, -30], [0, 0, 60]], np.float32)
    ground = Scene(corners, [[0, 2, 1]])
    samples = sample(ground, Camera.look_at((0, 4, -5), (0, 0, 0), width=300, height=150))
    scene = Scene(
        np.concatenate([corners, corners * 3 + np.array([0, 9, 0])]),
        [[0, 2, 1], [3, 5, 4]],
        [MATERIALS["solid"], MATERIALS["printed"]],
        [0, 1],
        uv=np.arange(12).reshape(6, 2) / 4,
    )
    mask = prepared(scene).shadow(Light.point((1, 50, 2)), samples)
    assert mask.stats["fallbacks"] == samples.covered.sum()
    assert mask.stats["sample_frustum_tests"] < samples.covered.sum() // 4
    few = np.random.default_rng(0).choice(np.flatnonzero(samples.covered), 300, replace=False)
    truth = arriving(scene, Light.point((1, 50, 2)), samples.take(few))
    np.testing.assert_allclose(mask.partial.reshape(-1, 3)[few], truth, rtol=0, atol=1e-5)


# By chance


def by_chance(scene, light, samples, seed=3):
    """The mask, once it is known to be that of `frustum`."""
    options = {"transparency": "stochastic", "seed": seed}
    mask = prepared(scene, **options).shadow(light, samples)
    truth = METHODS["frustum"](**options).prepare(scene).shadow(light, samples)
    np.testing.assert_array_equal(mask.partial, truth.partial)
    np.testing.assert_array_equal(mask.in_shadow, truth.in_shadow)
    assert mask.guarantee == truth.guarantee == Guarantee.NONE and set(np.unique(mask.partial)) == {0.0, 1.0}
    return mask


@pytest.mark.parametrize("seed", [0, 3, 2**62 + 1])
@pytest.mark.parametrize("per_pixel", [1, 4, 7])
def test_chances_are_those_of_the_cpu(seed, per_pixel):
    scene = mixed(seed % 7, colors=True)
    samples = sample(scene, Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=88, height=60), per_pixel)
    for light in (Light.point((1, 5, 2)), Light.directional((0.2, -1, 0.1)), Light.point((0.1, 0.2, 0.0))):
        mask = by_chance(scene, light, samples, seed)
        exact = prepared(scene).shadow(light, samples)
        between = (exact.partial > 0) & (exact.partial < 1)
        assert between.sum() > 100
        np.testing.assert_array_equal(mask.partial[~between], exact.partial[~between])
        for channel in range(3):
            share, drawn = exact.partial[..., channel], mask.partial[..., channel]
            assert abs((drawn - share).sum()) < 4 * np.sqrt((share * (1 - share)).sum())


def test_chances_of_lists_go_by_their_order(monkeypatch):
    scene, light = mixed(2, count=60), Light.point((1, 5, 2))
    points = ViewSamples.points(np.random.default_rng(3).uniform(-2, 2, (30, 40, 3)))
    whole = by_chance(scene, light, points)
    monkeypatch.setattr(layout, "BLOCK", 320)
    np.testing.assert_array_equal(by_chance(scene, light, points).partial, whole.partial)


def test_chances_do_not_depend_on_bands_batches_or_room(monkeypatch):
    scene, light = mixed(1, count=60), Light.point((1, 5, 2))
    samples = sample(scene, Camera.look_at((2, 4, 5), (0, -1, 0), fov_y=60, width=75, height=40), 4)
    whole = by_chance(scene, light, samples)
    monkeypatch.setattr(layout, "BLOCK", 3000)
    monkeypatch.setattr(frames, "BATCH", 7)
    monkeypatch.setattr(frames, "ROOM", 2)
    np.testing.assert_array_equal(by_chance(scene, light, samples).partial, whole.partial)


def test_chance_decides_as_well_what_float64_leaves_open():
    # Points below the edges of panes, to the last bit.
    steps = np.arange(-2, 3)
    corners = np.stack(np.meshgrid(steps, [1], steps, indexing="ij"), axis=-1).reshape(-1, 3)
    at = np.arange(25).reshape(5, 5)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    pane = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    scene = Scene(corners, pane, [MATERIALS["glass"]], [0] * len(pane))
    grid = np.stack(np.meshgrid(np.arange(-12, 13) / 8, [0], np.arange(-12, 13) / 8), axis=-1)
    points = ViewSamples.points(np.repeat(grid.reshape(-1, 1, 3), 40, axis=1))
    mask = by_chance(scene, Light.directional((0, -1, 0)), points)
    assert mask.stats["predicate_fallbacks"] > 1000
    # Each point has one pane above it, also where two or six meet.
    through = mask.partial.mean(axis=(0, 1))
    np.testing.assert_allclose(through, (0.72, 0.4, 0.08), rtol=0, atol=4 * 0.5 / np.sqrt(points.size))


def test_chance_has_no_say_where_all_is_solid():
    spheres = models.spheres((2, 2), 200)
    mask = prepared(spheres, transparency="stochastic").shadow(light_over(spheres), picture_of(spheres))
    assert mask.guarantee is Guarantee.EXACT and mask.partial is None


@pytest.mark.parametrize("method", ["frustum", "frustum-gl"])
def test_points_of_a_light_have_chances_of_their_own(method):
    # All light passes the same triangle: with the same chances for each point it would be all or nothing.
    scene = Scene([(-99, 1, -99), (-99, 1, 99), (198, 1, 0)], [(0, 1, 2)], [MATERIALS["veil"]])
    points = ViewSamples.points(np.random.default_rng(1).uniform((-1, -1, -1), (1, 0, 1), (2000, 3)))
    lamp = Light.point((0, 5, 0), radius=0.5)
    chosen = METHODS[method](transparency="stochastic")
    mask = average_over_light(chosen.prepare(scene), lamp, points, 32)
    share = mask.transmittance[:, 0].astype(float)
    error = np.sqrt(0.3 * 0.7 / 32)
    assert abs(share.mean() - 0.7) < 4 * error / np.sqrt(2000)
    assert share.std() == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize(
    "light", [Light.directional((0, -1, 0)), Light.directional((1, -2, -1)), Light.point((2, 3, 2))]
)
@pytest.mark.parametrize("alpha_mode", ["BLEND", "MASK"])
def test_an_edge_of_the_own_pane_counts_once(alpha_mode, light):
    # A sheet seen from below, and each sample moved to an edge of its triangle.
    grid = np.linspace(0, 4, 5)
    positions = [(x, 1.0, z) for z in grid for x in grid]
    quads = [(a, a + 1, a + 5, a + 6) for a in (5 * j + i for j in range(4) for i in range(4))]
    triangles = [t for a, b, c, d in quads for t in ((a, c, d), (a, d, b))]
    scene = Scene(np.array(positions), triangles, [Material((0.5, 0.5, 0.5, 0.5), alpha_mode, alpha_cutoff=0.25)])
    scene = scene if alpha_mode == "BLEND" else dataclasses.replace(
        scene, materials=[Material((1, 1, 1, 1), "MASK", texture=np.array([[[255] * 4, [255] * 3 + [0]]], np.uint8))],
        uv=np.full((25, 2), 0.25),
    )  # fmt: skip
    samples = sample(scene, Camera.look_at((2, -3, 2.01), (2, 1, 2), fov_y=40, width=48, height=40))
    uv = samples.barycentric.copy()
    uv[::3, :, 0] = 0
    uv[1::3, :, 1] = 0
    uv[2::3, :, 1] = 1 - uv[2::3, :, 0]
    on_edge = ViewSamples.on_surface(scene, samples.triangle[samples.covered], uv[samples.covered], 1)
    position = samples.position.copy()
    position[samples.covered] = on_edge.position
    samples = dataclasses.replace(samples, barycentric=uv, position=position)
    inner = samples.covered & ((position[..., [0, 2]] > 0.01) & (position[..., [0, 2]] < 3.99)).all(axis=-1)
    assert inner.sum() > 500
    mask = prepared(scene).shadow(light, samples)
    np.testing.assert_allclose(mask.transmittance[inner], 0.5 if alpha_mode == "BLEND" else 0, rtol=0, atol=1e-5)
    assert verify(scene, light, samples, mask).ok
