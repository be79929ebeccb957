"""What gets through translucent, coloured and textured casters, against rationals and a formula of its own."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

import umbrae.methods.frustum_cpu
import umbrae.methods.frustum_tasks
from truth import lattice_soup, random_samples, random_soup
from umbrae import Camera, InputError, Light, Material, OptionError, Scene, ViewSamples, sample, shadow
from umbrae.geometry.predicates import SHADOWED, facing, shadows
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.oracle import Exact, Oracle
from umbrae.models import sphere, spheres
from umbrae.samples import surface_points

LIGHTS = [(0, 5, 0, 1), (1, 1, 1, 0), (3, -2, 1, 1), (0, 0, 1, 0), (0, 0, 0, 1), (0.1, 0.2, 0.05, 1), (-3, -1, 0, 0)]

Pairs = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]
"""Samples, the triangles that shadow them, and the barycentrics of where."""


def noise(seed: int, size: tuple[int, int] = (5, 7)) -> NDArray[np.uint8]:
    """A texture with whole regions that are opaque, and clear."""
    texels = np.random.default_rng(seed).integers(0, 256, (*size, 4)).astype(np.uint8)
    texels[:2, :4, 3] = 255
    texels[2:, 4:, 3] = 0
    return texels


MATERIALS = [
    Material((0.5, 0.5, 0.5, 1.0)),
    Material((0.9, 0.5, 0.1, 0.5), "BLEND"),
    Material((1.0, 0.25, 0.0, 1.0), transmission=0.7),
    Material((1.0, 1.0, 1.0, 1.0), "MASK", texture=noise(1)),
    Material((0.9, 0.8, 1.0, 1.0), "BLEND", transmission=0.5, texture=noise(2)),
    Material((0.5, 0.5, 0.5, 0.0), "BLEND"),
    Material((0.5, 0.5, 0.5, 1.0), "BLEND"),
    Material((0.2, 1.0, 0.7, 0.8), "MASK", transmission=0.6, texture=noise(3)),
    Material((0.1, 0.2, 0.3, 0.4), "MASK"),
    Material((0.9, 0.8, 1.0, 1.0), "BLEND", texture=noise(4)),
]


def dressed(scene: Scene, rng: np.random.Generator, kinds: list[int], colors: bool = False) -> Scene:
    """The scene with random materials of those kinds, texture coordinates and perhaps vertex colours."""
    vertices = len(scene.positions)
    tint = rng.integers(0, 5, (vertices, 4)) / 4
    tint[rng.random(vertices) < 0.7] = 1.0
    return Scene(
        scene.positions,
        scene.triangles,
        MATERIALS,
        rng.choice(kinds, len(scene.triangles)),
        uv=rng.uniform(-1, 2, (vertices, 2)),
        colors=tint if colors else None,
    )


def bilinear(texels: NDArray[np.uint8], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear colour and alpha of a repeated sRGB texture (IEC 61966-2-1): four texels, each by its area."""
    coded = texels / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    linear[..., 3] = coded[..., 3]
    height, width = texels.shape[:2]
    x, y = (uv[:, 0] % 1.0) * width - 0.5, (uv[:, 1] % 1.0) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    found = np.zeros((len(uv), 4))
    for i in (0, 1):
        for j in (0, 1):
            area = (1 - np.abs(x - left - i)) * (1 - np.abs(y - top - j))
            found += area[:, None] * linear[(top + j) % height, (left + i) % width]
    return found


def passed(scene: Scene, t: NDArray[np.intp], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(1 - a) + a t c` of triangles at barycentrics `(n, 3)`; NaN where alpha is too near the cutoff to say."""
    found = np.empty((len(t), 3))
    corners = scene.triangles[t]
    for number, material in enumerate(scene.materials):
        these = scene.material_id[t] == number
        value = np.tile(np.array(material.base_color), (these.sum(), 1))
        if material.texture is not None:
            value *= bilinear(material.texture, np.einsum("nk,nkj->nj", weights[these], scene.uv[corners[these]]))
        if scene.colors is not None:
            value *= np.einsum("nk,nkj->nj", weights[these], scene.colors[corners[these]])
        alpha = np.minimum(value[:, 3], 1.0)
        if material.alpha_mode == "OPAQUE":
            alpha[:] = 1.0
        elif material.alpha_mode == "MASK":
            near = np.abs(alpha - material.alpha_cutoff) < (0 if material.texture is None else 1e-9)
            alpha = np.where(near, np.nan, alpha >= material.alpha_cutoff)
        alpha[alpha > 1 - 1e-13] = 1.0  # sums of weights that ought to be 1
        found[these] = (1 - alpha)[:, None] + (alpha * material.transmission)[:, None] * value[:, :3]
    return found


def closed(scene: Scene) -> NDArray[np.bool_]:
    """`(t,)`, whether side planes belong to a triangle: it is opaque wherever it is there at all."""
    plain = np.ones(len(scene.triangles), bool)
    if scene.colors is not None:
        plain = (scene.colors[scene.triangles] == 1).all(axis=(1, 2))
    found = np.empty(len(scene.triangles), bool)
    for t, number in enumerate(scene.material_id):
        m = scene.materials[number]
        solid = m.alpha_mode != "BLEND" or (m.base_color[3] == 1.0 and m.texture is None and plain[t])
        found[t] = m.transmission == 0.0 and solid
    return found


def rational_pairs(scene: Scene, light: Light, samples: ViewSamples) -> Pairs:
    """All pairs of samples of a list and triangles that shadow them, each asked in rationals."""
    exact, closed_of = Exact(scene, light), closed(scene)
    index, triangle, weights = [], [], []
    for i in range(samples.size):
        for t in range(len(scene.triangles)):
            if exact.shades(samples, i, t, closed=bool(closed_of[t])):
                index.append(i)
                triangle.append(t)
                weights.append(rational_weights(exact, samples, i, t))
    return np.array(index, int), np.array(triangle, int), np.array(weights, float).reshape(-1, 3)


def rational_weights(exact: Exact, samples: ViewSamples, index: int, t: int) -> list[float]:
    """Where the ray from a sample to the light meets triangle t, or the sample itself on its own triangle."""
    own = int(samples.triangle[index])
    point = [Fraction(float(x)) for x in samples.position[index]]
    if own >= 0:
        u, v = (Fraction(float(x)) for x in samples.barycentric[index])
        if own == t:
            return [float(1 - u - v), float(u), float(v)]
        a, b, c = exact.corners(own)
        point = [a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]) for k in range(3)]
    d = [exact.light[k] - exact.w * point[k] for k in range(3)]

    def volume(p, q):
        """det(d, p - point, q - point)"""
        p, q = [p[k] - point[k] for k in range(3)], [q[k] - point[k] for k in range(3)]
        x, y, z = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
        return d[0] * x + d[1] * y + d[2] * z

    a, b, c = exact.corners(t)
    parts = volume(b, c), volume(c, a), volume(a, b)
    return [float(part / sum(parts)) for part in parts]


@njit(nogil=True)
def predicate_pairs(positions, triangles, light, own, barycentric, side, position, closed_of):
    """The same by the predicate, which other tests hold against rationals."""
    facings = np.array([facing(positions, triangles, t, light) for t in range(len(triangles))])
    index, triangle = [0], [0]
    for i in range(len(own)):
        point = np.empty(3)
        u, v = np.float64(barycentric[i, 0]), np.float64(barycentric[i, 1])
        for t in range(len(triangles)):
            point[:] = position[i]
            if facings[t] == 0:
                hit = False
            elif t == own[i] and closed_of[t]:
                hit = side[i] * facings[t] < 0
            else:
                args = light, own[i], u, v, np.int64(side[i]), point, closed_of[t]
                hit = shadows(positions, triangles, t, facings[t], *args) & SHADOWED != 0
            if hit:
                index.append(i)
                triangle.append(t)
    return index[1:], triangle[1:]


def all_pairs(scene: Scene, light: Light, samples: ViewSamples) -> Pairs:
    """All pairs by the predicate, with barycentrics in float64."""
    source = light.position.astype(np.float64)
    found = predicate_pairs(
        scene.positions, scene.triangles, source, samples.triangle, samples.barycentric, samples.side,
        samples.position, closed(scene),
    )  # fmt: skip
    index, t = (np.array(part, int) for part in found)
    points = samples.position.astype(np.float64)
    on_surface = samples.triangle >= 0
    points[on_surface] = surface_points(scene, samples.triangle[on_surface], samples.barycentric[on_surface])
    a, b, c = np.moveaxis(scene.positions[scene.triangles[t]].astype(np.float64), 1, 0)
    p = points[index]
    d = source[:3] - source[3] * p
    parts = [np.einsum("ni,ni->n", d, np.cross(x - p, y - p)) for x, y in ((b, c), (c, a), (a, b))]
    weights = np.stack(parts, axis=1)
    itself = samples.triangle[index] == t
    u, v = samples.barycentric[index].astype(np.float64).T
    weights[itself] = np.stack([1 - u - v, u, v], axis=1)[itself]
    return index, t, weights / weights.sum(axis=1, keepdims=True)


def product(scene: Scene, count: int, pairs: Pairs) -> NDArray[np.float64]:
    """`(n, 3)` what arrives; NaN where some cutoff is too near."""
    index, t, weights = pairs
    arriving = np.ones((count, 3))
    np.multiply.at(arriving, index, passed(scene, t, weights))
    return arriving


def check(mask: ShadowMask, truth: NDArray[np.float64]) -> float:
    """Compare a mask with the truth; returns the share of samples that are neither lit nor dark."""
    known = ~np.isnan(truth).any(axis=-1)
    assert mask.guarantee is Guarantee.EXACT and known.mean() > 0.95
    assert mask.tolerance == (0.0 if mask.partial is None else 1e-5)
    np.testing.assert_array_equal(mask.in_shadow[known], (truth[known] == 0).all(axis=-1))
    np.testing.assert_allclose(mask.transmittance[known], truth[known], rtol=0, atol=1e-5)
    assert ((mask.transmittance == 0).all(axis=-1) == mask.in_shadow).all()
    return float(((truth > 0) & (truth < 1)).any(axis=-1).mean())


def both(scene: Scene, rng: np.random.Generator, count: int) -> ViewSamples:
    """Sensors on faces and free points in one list."""
    sensors = random_samples(rng, scene, count)
    points = ViewSamples.points(rng.integers(-12, 13, (count, 3)) / 4)
    fields = ("triangle", "barycentric", "side", "position", "covered")
    return ViewSamples(*(np.concatenate([getattr(part, name) for part in (sensors, points)]) for name in fields))


@pytest.mark.parametrize("position", LIGHTS)
@pytest.mark.parametrize("kinds", [[0, 1, 2, 5, 6, 8], [3, 4, 7, 9, 1, 0], [1, 2], [5]], ids=str)
@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
def test_every_share_agrees_with_rationals(soup, kinds, position):
    rng = np.random.default_rng(len(kinds))
    light = Light(np.array(position))
    scene = dressed(soup(rng, 12), rng, kinds, colors=soup is lattice_soup and 5 not in kinds)
    samples = both(scene, rng, 35)
    truth = product(scene, samples.size, rational_pairs(scene, light, samples))
    partly = check(shadow(scene, light, samples), truth)
    assert (partly == 0) == (kinds == [5])


@pytest.mark.parametrize("position", [*LIGHTS, (1e6, 2e6, 1e5, 1), (1e-20, 1e-20, -1e-20, 0)])
def test_many_triangles(position):
    rng = np.random.default_rng(5)
    scene = dressed(random_soup(rng, 1500, 0.2), rng, [0, *range(1, 10), 5, 5, 5])
    light = Light(np.array(position))
    samples = both(scene, rng, 300)
    pairs = all_pairs(scene, light, samples)
    check(shadow(scene, light, samples), product(scene, samples.size, pairs))


@pytest.mark.parametrize("gap", [0.0, 1e-30, 1e-12, 1e-7])
def test_samples_at_and_next_to_a_point_light(gap):
    rng = np.random.default_rng(6)
    scene = dressed(random_soup(rng, 100), rng, [1, 2, 3, 5])
    light = Light.point((0.25, 0.5, -0.125))
    points = np.array([0.25, 0.5, -0.125]) + gap * rng.normal(size=(30, 3))
    samples = ViewSamples.points(np.concatenate([points, rng.uniform(-1, 1, (200, 3))]))
    assert check(shadow(scene, light, samples), product(scene, 230, all_pairs(scene, light, samples))) > 0.1


def cards(materials: list[Material], floor: Material | None = None) -> Scene:
    """A floor and sheets above it, of two triangles each, that cover it all."""
    positions, triangles, uv = [], [], []
    for level in range(len(materials) + 1):
        reach = 10 if level == 0 else 8
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        positions += [(reach * x, 0 if level == 0 else 2 + 0.25 * level, reach * z) for x, z in corners]
        uv += [(2 * x, 2 * z) for x, z in corners]
        triangles += [(4 * level, 4 * level + 2, 4 * level + 1), (4 * level, 4 * level + 3, 4 * level + 2)]
    number = np.repeat(np.arange(len(materials) + 1), 2)
    return Scene(np.array(positions, float), np.array(triangles), [floor or Material(), *materials], number, uv=uv)


BELOW = Camera.look_at((0, 1.9, 0.01), (0, 0, 0), fov_y=100, width=288, height=256)
ABOVE = Light.point((1, 9, 2))


def test_textured_cards_over_a_whole_picture(monkeypatch):
    scene = cards([MATERIALS[4], MATERIALS[3], MATERIALS[1]])
    samples = sample(scene, BELOW)
    mask = shadow(scene, ABOVE, samples)
    assert mask.stats["queued_tiles"] > 5 and mask.stats["texture_lookups"] > samples.size
    chosen = np.random.default_rng(1).choice(samples.size, 4000, replace=False)
    few = samples.take(chosen)
    part = ShadowMask(
        mask.in_shadow.reshape(-1)[chosen], mask.guarantee, partial=mask.partial.reshape(-1, 3)[chosen], tolerance=1e-5
    )
    assert check(part, product(scene, few.size, all_pairs(scene, ABOVE, few))) > 0.3
    # What finds no room in the queue is refined.
    monkeypatch.setattr(umbrae.methods.frustum_tasks, "QUEUE", 3)
    crowded = shadow(scene, ABOVE, samples)
    assert 0 < crowded.stats["queued_tiles"] < mask.stats["queued_tiles"]
    np.testing.assert_array_equal(crowded.partial, mask.partial)


@pytest.mark.parametrize(
    "light", [Light.point((0, 6, 1)), Light.directional((-1, -2, -0.7)), Light.point((0, 0.01, 0))]
)
def test_whole_picture_of_spheres(light):
    scene = spheres(grid=(3, 3), triangles=3000)
    rng = np.random.default_rng(7)
    scene = Scene(
        scene.positions, scene.triangles, MATERIALS, rng.choice([0, 1, 2, 4, 9], len(scene.triangles)),
        uv=rng.uniform(0, 1, (len(scene.positions), 2)),
    )  # fmt: skip
    samples = sample(scene, Camera.frame(scene, width=160, height=90))
    mask = shadow(scene, light, samples)
    chosen = np.random.default_rng(1).permutation(np.flatnonzero(samples.covered.reshape(-1)))[:1200]
    few = samples.take(chosen)
    part = ShadowMask(
        mask.in_shadow.reshape(-1)[chosen], mask.guarantee, partial=mask.partial.reshape(-1, 3)[chosen], tolerance=1e-5
    )
    assert check(part, product(scene, few.size, all_pairs(scene, light, few))) > 0.01
    assert (mask.transmittance[~samples.covered] == 1).all()


MIXED = cards([MATERIALS[4], MATERIALS[1], Material((1.0, 0.25, 0.5, 1.0), transmission=0.7), MATERIALS[9]])


@pytest.mark.parametrize("transparency", ["exact", "stochastic"])
def test_neither_threads_nor_blocks_nor_order_change_a_bit(transparency, monkeypatch):
    method = Frustum(transparency=transparency)
    rng = np.random.default_rng(2)
    crowd = dressed(random_soup(rng, 400), rng, [0, 1, 2, 3, 4, 5, 5, 5])
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=96, height=64)
    for scene, samples, light in (
        (MIXED, sample(MIXED, BELOW), ABOVE),
        (crowd, sample(crowd, camera, samples_per_pixel=4), Light.point((0.1, 0.2, 0.05))),
    ):
        wanted = shadow(scene, light, samples, method)
        for threads in ("1", "5"):
            monkeypatch.setenv("UMBRAE_THREADS", threads)
            again = shadow(scene, light, samples, method)
            np.testing.assert_array_equal(again.partial, wanted.partial)
            np.testing.assert_array_equal(again.in_shadow, wanted.in_shadow)
        with monkeypatch.context() as patch:
            patch.setattr(umbrae.methods.frustum_cpu, "BLOCK", 1 << 12)
            np.testing.assert_array_equal(shadow(scene, light, samples, method).partial, wanted.partial)
    # Free points know no triangle's number, so the scene may be in any order; chance depends on the numbers.
    points = ViewSamples.points(rng.uniform(-1, 1, (2000, 3)))
    order = rng.permutation(len(crowd.triangles))
    moved = Scene(crowd.positions, crowd.triangles[order], crowd.materials, crowd.material_id[order], uv=crowd.uv)
    one, other = (shadow(scene, light, points, method) for scene in (crowd, moved))
    assert (one.partial == other.partial).all() == (transparency == "exact")


def pane(alpha: float = 0.5, cells: int = 1, **more: float) -> Scene:
    """A square sheet from (0, 1, 0) to (4, 1, 4), of `cells` x `cells` quads whose diagonals alternate."""
    grid = np.linspace(0, 4, cells + 1)
    positions = [(x, 1.0, z) for z in grid for x in grid]
    triangles = []
    for j in range(cells):
        for i in range(cells):
            a, b = j * (cells + 1) + i, (j + 1) * (cells + 1) + i
            triangles += [(a, b, b + 1), (a, b + 1, a + 1)] if (i + j) % 2 else [(a, b, a + 1), (a + 1, b, b + 1)]
    return Scene(np.array(positions), np.array(triangles), [Material((0.5, 0.5, 0.5, alpha), "BLEND", **more)])


@pytest.mark.parametrize("cells", [1, 4])
@pytest.mark.parametrize(
    "light", [Light.directional((0, -1, 0)), Light.point((2, 3, 2)), Light.directional((1, -2, 1))]
)
def test_shared_edges_count_once(cells, light):
    scene = pane(0.5, cells)
    x, z = (part.reshape(-1) for part in np.meshgrid(np.linspace(0.25, 3.75, 29), np.linspace(0.25, 3.75, 29)))
    on_pane = np.stack([x, np.ones_like(x), z], axis=1)
    source = light.position.astype(float)
    toward = source[:3] - source[3] * on_pane
    # Below every place of the grid, among them all vertices and many places on edges, along the ray from the light.
    points = on_pane - toward / 2
    samples = ViewSamples.points(points)
    assert (samples.position == points).all(), "a point is not representable"
    np.testing.assert_allclose(shadow(scene, light, samples).transmittance, 0.5, rtol=0, atol=1e-7)


@pytest.mark.parametrize("poster", [0, 1])
def test_coincident_triangles(poster):
    sheets = [MATERIALS[1], MATERIALS[poster]]
    for flip in (False, True):
        triangles = np.array([[0, 1, 2], [2, 1, 0] if flip else [1, 2, 0]])
        scene = Scene(np.array([[0, 0, 0], [0, 0, 4], [4, 0, 0]]), triangles, sheets, [0, 1])
        up = shadow(scene, Light.point((1, 3, 1)), ViewSamples.on_surface(scene, [0, 0], [[0.25, 0.25]] * 2, [1, -1]))
        np.testing.assert_array_equal(up.transmittance[0], 1.0)
        np.testing.assert_allclose(up.transmittance[1], 0.25 if poster else 0.0, atol=1e-7)
        assert up.in_shadow.tolist() == [False, poster == 0]


def test_own_triangle_turned_away_dims_once():
    textured = Scene(
        np.array([[0, 0, 0], [0, 0, 4], [4, 0, 0]]), np.array([[0, 1, 2]]), [MATERIALS[9]],
        uv=np.array([[0.1, 0.9], [1.3, 0.2], [0.4, 1.7]]),
    )  # fmt: skip
    rng = np.random.default_rng(3)
    uv = rng.integers(0, 32, (200, 2)) / 64
    for side in (1, -1, 0):
        samples = ViewSamples.on_surface(textured, np.zeros(200, int), uv, side)
        mask = shadow(textured, Light.directional((0, -1, 0)), samples)
        weights = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
        truth = passed(textured, np.zeros(200, int), weights) if side == -1 else np.ones((200, 3))
        check(mask, truth)
        assert side != -1 or (0.05 < mask.in_shadow.mean() < 0.9 and mask.transmittance.max() == 1.0)


def on_own_edges(scene: Scene) -> ViewSamples:
    """The corners and the middles of the edges of all triangles, seen from below, by each triangle that has them."""
    uv = np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0, 0.5), (0.5, 0.5)], np.float32)
    triangle = np.repeat(np.arange(len(scene.triangles)), len(uv))
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(float), 1, 0)
    below = np.where(np.cross(b - a, c - a)[:, 1] > 0, -1, 1)
    samples = ViewSamples.on_surface(scene, triangle, np.tile(uv, (len(below), 1)), below[triangle])
    inner = ((samples.position[:, [0, 2]] > 0) & (samples.position[:, [0, 2]] < 4)).all(axis=1)
    return samples.take(np.flatnonzero(inner))


@pytest.mark.parametrize(
    "method", [Frustum(), Frustum(transparency="stochastic"), Oracle(light_samples=8)], ids=lambda m: m.name
)
@pytest.mark.parametrize(
    "light",
    [
        Light.directional((0, -1, 0)),
        Light.directional((1, -2, -1)),
        Light.point((2, 3, 2)),
        Light.point((0.5, 9, 3)),
        Light.point((2, 3, 2), radius=1e-12),
        Light.point((1, 6, 3), radius=0.5),
    ],
    ids=str,
)
@pytest.mark.parametrize("alpha", [0.5, 1.0])
def test_an_edge_of_the_own_pane_counts_once(alpha, light, method):
    # Opaque where it can be seen, but not solid: a texture that is clear somewhere else.
    scene = pane(0.5, 4)
    if alpha == 1.0:
        texels = np.full((1, 4, 4), 255, np.uint8)
        texels[0, 3, 3] = 0
        uv = np.full((len(scene.positions), 2), 0.3)
        uv[-1] = 0.3, 0.3
        scene = Scene(scene.positions, scene.triangles, [Material((1, 1, 1, 1.0), "BLEND", texture=texels)], uv=uv)
    samples = on_own_edges(scene)
    mask = shadow(scene, light, samples, method)
    if method == Frustum(transparency="stochastic") and alpha < 1.0 and light.radius != 1e-12:
        # By chance all light or none, and of a wide light that of either triangle for a part of it.
        assert light.is_area or set(np.unique(mask.transmittance)) == {0.0, 1.0}
        assert 0.4 < mask.transmittance.mean() < 0.6
    else:
        np.testing.assert_allclose(mask.transmittance, 1 - alpha, rtol=0, atol=1e-6)
    assert (mask.in_shadow == (mask.transmittance == 0).all(axis=1)).all()
    # From above nothing of it is in the way.
    above = dataclasses.replace(samples, side=-samples.side)
    assert (shadow(scene, light, above, method).transmittance == 1).all()


def stack(materials: list[Material]) -> Scene:
    """One large triangle above another, all of which the origin sees at once."""
    corners = np.array([[-9, 0, -9], [-9, 0, 9], [18, 0, 0]], float)
    positions = np.concatenate([corners + np.array([0, 1 + level / 64, 0]) for level in range(len(materials))])
    return Scene(positions, np.arange(len(positions)).reshape(-1, 3), materials, np.arange(len(materials)))


UP = Light.directional((0, -1, 0))
ORIGIN = ViewSamples.points([[0, 0, 0]])


def test_colours_multiply_to_black():
    red, green = (Material((*rgb, 1.0), transmission=1.0) for rgb in ((1, 0, 0), (0, 1, 0)))
    assert shadow(stack([red]), UP, ORIGIN).transmittance.tolist() == [[1, 0, 0]]
    assert not shadow(stack([red]), UP, ORIGIN).in_shadow[0]
    for method in (Frustum(), Frustum(transparency="stochastic")):
        black = shadow(stack([red, green]), UP, ORIGIN, method)
        assert black.transmittance.tolist() == [[0, 0, 0]] and black.in_shadow[0]


@pytest.mark.parametrize(("alpha", "count"), [(0.5, 20), (0.01, 300), (0.5, 400), (1 - 2**-60, 40), (1e-9, 300)])
def test_many_casters_of_one_sample(alpha, count):
    mask = shadow(stack([Material((1, 1, 1, alpha), "BLEND")] * count), UP, ORIGIN)
    assert mask.transmittance[0] == pytest.approx((1 - alpha) ** count, abs=1e-7)
    # However little it is, light does arrive, unless the opacity is 1 in float64.
    assert mask.in_shadow[0] == (1 - alpha == 0.0) == (mask.transmittance[0] == 0).all()


def test_culling_leaves_alone_what_lets_light_through():
    balls = [sphere((3 * k, 0, 0), 1.0, 16, 10) for k in range(3)]
    starts = np.cumsum([0, *(len(ball.positions) for ball in balls)])
    scene = Scene(
        np.concatenate([ball.positions for ball in balls]),
        np.concatenate([ball.triangles + start for ball, start in zip(balls, starts, strict=False)]),
        [MATERIALS[0], MATERIALS[1], MATERIALS[6]],
        np.repeat([0, 1, 2], len(balls[0].triangles)),
    )
    samples = ViewSamples.points(np.random.default_rng(1).uniform((-2, -3, -2), (8, 2, 2), (3000, 3)))
    for light in (Light.directional((0.1, -1, 0.2)), Light.point((3, 5, 1))):
        plain, culled = (shadow(scene, light, samples, Frustum(front_face_culling=on)) for on in (False, True))
        np.testing.assert_array_equal(plain.partial, culled.partial)
        assert culled.stats["tile_frustum_tests"] < plain.stats["tile_frustum_tests"]
        assert (np.abs(plain.partial - 0.25) < 1e-6).any()  # in through one side and out through the other


def test_masks_of_opaque_and_of_clear_scenes_are_plain():
    clear = cards([MATERIALS[5]])
    for scene in (cards([MATERIALS[0]]), clear, cards([MATERIALS[6]]), MIXED.opaque()):
        mask = shadow(scene, ABOVE, sample(scene, BELOW), Frustum(transparency="stochastic"))
        assert mask.partial is None and mask.guarantee is Guarantee.EXACT and mask.tolerance == 0.0
        assert mask.stats["texture_lookups"] == mask.stats["queued_tiles"] == 0
        assert mask.in_shadow.mean() == (0 if scene is clear else pytest.approx(1, abs=0.3))
    none = Scene(np.zeros((0, 3)), np.zeros((0, 3), int), [MATERIALS[1]])
    assert (shadow(none, ABOVE, ORIGIN).transmittance == 1).all()
    assert shadow(MIXED, ABOVE, ViewSamples.points(np.zeros((0, 3)))).transmittance.shape == (0, 3)


STOCHASTIC = Frustum(transparency="stochastic")


def test_stochastic_bits_are_right_on_average():
    samples = sample(MIXED, BELOW)
    exact, mask = shadow(MIXED, ABOVE, samples), shadow(MIXED, ABOVE, samples, STOCHASTIC)
    assert mask.guarantee is Guarantee.NONE and set(np.unique(mask.partial)) == {0.0, 1.0}
    assert (mask.in_shadow == (mask.partial == 0).all(axis=-1)).all()
    for channel in range(3):
        p = exact.partial[..., channel].astype(float)
        deviation = np.sqrt((p * (1 - p)).sum())
        assert deviation > 10 and abs(mask.partial[..., channel].sum() - p.sum()) < 4 * deviation
        # In each part of the picture, too: bits must not go together.
        for part in (slice(0, 64), slice(100, 130), slice(200, None)):
            p = exact.partial[part, ..., channel].astype(float)
            assert abs(mask.partial[part, ..., channel].sum() - p.sum()) < 4 * np.sqrt((p * (1 - p)).sum())


@pytest.mark.parametrize("alpha", [0.3, 0.5, 0.9])
def test_samples_of_a_pixel_are_stratified(alpha):
    # One triangle above the floor: those of a pane are stratified each by itself, also in pixels on the diagonal.
    scene = cards([Material((1, 1, 1, alpha), "BLEND")])
    positions = scene.positions.copy()
    positions[4:] = [[-20, 2.5, -20], [60, 2.5, -20], [0, 2.5, 0], [-20, 2.5, 60]]
    scene = Scene(positions, [*scene.triangles[:2], [4, 7, 5]], scene.materials, [0, 0, 1])
    count = 16
    samples = sample(scene, Camera.look_at((0, 1.9, 0.01), (0, 0, 0), fov_y=100, width=64, height=64), count)
    exact = shadow(scene, ABOVE, samples)
    inside = np.isclose(exact.partial[..., 0], 1 - alpha).all(axis=-1)
    hits = (shadow(scene, ABOVE, samples, STOCHASTIC).partial[inside, :, 0] == 0).sum(axis=1)
    assert inside.sum() > 2000
    assert ((hits >= np.floor(count * alpha)) & (hits <= np.ceil(count * alpha))).all()
    # Free points are pixels of their own: there it is a binomial variable.
    points = ViewSamples.points(samples.position[inside].reshape(-1, 3))
    loose = (shadow(scene, ABOVE, points, STOCHASTIC).partial[:, 0] == 0).reshape(-1, count).sum(axis=1)
    assert loose.var() == pytest.approx(count * alpha * (1 - alpha), rel=0.2)
    assert hits.var() < 0.3 and hits.var() < loose.var() / 4
    for found in (hits, loose):
        assert abs(found.mean() - count * alpha) < 4 * np.sqrt(count * alpha * (1 - alpha) / len(found))
    # Which samples of a pixel are hit is as random: each of the 16 as often.
    chosen = shadow(scene, ABOVE, samples, STOCHASTIC).partial[inside, :, 0] == 0
    spread = np.sqrt(alpha * (1 - alpha) / inside.sum())
    assert (np.abs(chosen.mean(axis=0) - alpha) < 4.5 * spread).all()


def test_casters_of_one_pixel_are_independent():
    scene = cards([Material((1, 1, 1, 0.5), "BLEND")] * 2)
    samples = sample(scene, Camera.look_at((0, 1.9, 0.01), (0, 0, 0), fov_y=100, width=64, height=64), 16)
    inside = np.isclose(shadow(scene, ABOVE, samples).partial[..., 0], 0.25).all(axis=-1)
    lit = shadow(scene, ABOVE, samples, STOCHASTIC).partial[inside, :, 0]
    assert abs(lit.mean() - 0.25) < 4 * np.sqrt(0.25 * 0.75 / lit.size)


def test_seeds():
    samples = sample(MIXED, BELOW)
    first, same, other = (
        shadow(MIXED, ABOVE, samples, Frustum(transparency="stochastic", seed=seed)).partial for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first, same)
    assert 0.1 < (first != other).any(axis=-1).mean() < 0.9


@pytest.mark.parametrize("options", [{"transparency": "sorted"}, {"seed": -1}, {"seed": 1 << 63}])
def test_options_out_of_range(options):
    with pytest.raises(OptionError, match=r"frustum: (transparency|seed)"):
        Frustum(**options)


def test_bad_seed_and_missing_texture_coordinates():
    with pytest.raises(InputError, match="seed: wanted a whole number"):
        Frustum(seed=0.5)  # type: ignore[arg-type]
    bare = Scene(MIXED.positions, MIXED.triangles, MIXED.materials, MIXED.material_id)
    with pytest.raises(InputError, match="no texture coordinates"):
        shadow(bare, ABOVE, ORIGIN)
