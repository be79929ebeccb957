"""What gets through translucent, coloured and textured casters, against rationals and a formula of its own."""

import numpy as np
import pytest
from numpy.typing import NDArray

from truth import lattice_soup, random_samples, random_soup
from umbrae import Light, Material, Scene, ViewSamples, shadow
from umbrae.mask import Guarantee
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.oracle import Exact

LIGHTS = [(0, 5, 0, 1), (1, 1, 1, 0), (3, -2, 1, 1), (0, 0, 1, 0), (0, 0, 0, 1), (0.1, 0.2, 0.05, 1), (-3, -1, 0, 0)]


def texture(seed: int, size: tuple[int, int] = (5, 7)) -> NDArray[np.uint8]:
    """Noise with whole regions that are opaque, and clear."""
    texels = np.random.default_rng(seed).integers(0, 256, (*size, 4)).astype(np.uint8)
    texels[:2, :4, 3] = 255
    texels[2:, 4:, 3] = 0
    return texels


MATERIALS = [
    Material((0.5, 0.5, 0.5, 1.0)),
    Material((0.9, 0.5, 0.1, 0.5), "BLEND"),
    Material((1.0, 0.25, 0.0, 1.0), transmission=0.7),
    Material((1.0, 1.0, 1.0, 1.0), "MASK", texture=texture(1)),
    Material((0.9, 0.8, 1.0, 0.9), "BLEND", transmission=0.5, texture=texture(2)),
    Material((0.5, 0.5, 0.5, 0.0), "BLEND"),
    Material((0.5, 0.5, 0.5, 1.0), "BLEND"),
    Material((0.2, 1.0, 0.7, 0.8), "MASK", transmission=0.6, texture=texture(3)),
    Material((0.1, 0.2, 0.3, 0.4), "MASK"),
]


def dressed(scene: Scene, rng: np.random.Generator, kinds: list[int], colors: bool) -> Scene:
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


def linear(texels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear colour and alpha of sRGB texels (IEC 61966-2-1)."""
    c = texels / 255.0
    c[..., :3] = np.where(c[..., :3] <= 0.04045, c[..., :3] / 12.92, ((c[..., :3] + 0.055) / 1.055) ** 2.4)
    return c


def bilinear(texels: NDArray[np.uint8], u: float, v: float) -> NDArray[np.float64]:
    """A texture at (u, v), repeated: the mean of four texels by area."""
    height, width = texels.shape[:2]
    x, y = (u % 1.0) * width - 0.5, (v % 1.0) * height - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    found = np.zeros(4)
    for i in (0, 1):
        for j in (0, 1):
            weight = (1 - abs(x - left - i)) * (1 - abs(y - top - j))
            found += weight * linear(texels[(top + j) % height, (left + i) % width].astype(float))
    return found


def shares(scene: Scene, t: int, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(1 - a) + a t c` of triangle t at barycentrics `(3,)`; NaN where alpha is too near the cutoff to say."""
    material = scene.materials[scene.material_id[t]]
    value = np.array(material.base_color)
    if material.texture is not None:
        value = value * bilinear(material.texture, *(weights @ scene.uv[scene.triangles[t]].astype(float)))
    if scene.colors is not None:
        value = value * (weights @ scene.colors[scene.triangles[t]].astype(float))
    alpha = min(float(value[3]), 1.0)
    if material.alpha_mode == "OPAQUE":
        alpha = 1.0
    elif material.alpha_mode == "MASK":
        textured = material.texture is not None or scene.colors is not None
        if textured and 0 < abs(alpha - material.alpha_cutoff) < 1e-9:
            return np.full(3, np.nan)
        alpha = float(alpha >= material.alpha_cutoff)
    passed = (1 - alpha) + alpha * material.transmission * value[:3]
    passed[passed < 1e-13] = 0.0  # sums of weights that ought to be 1
    return passed


def closed(scene: Scene, t: int) -> bool:
    """Whether side planes belong to the triangle: opaque wherever it is there at all."""
    material = scene.materials[scene.material_id[t]]
    if material.transmission > 0:
        return False
    plain = material.texture is None and (scene.colors is None or (scene.colors[scene.triangles[t]] == 1).all())
    return material.alpha_mode != "BLEND" or (material.base_color[3] == 1.0 and bool(plain))


def weights_of(exact: Exact, samples: ViewSamples, index: int, t: int) -> NDArray[np.float64]:
    """Barycentrics of the place where the ray from a sample to the light meets triangle t, in rationals."""
    from fractions import Fraction

    own = int(samples.triangle[index])
    point = [Fraction(float(x)) for x in samples.position[index]]
    if own >= 0:
        u, v = (Fraction(float(x)) for x in samples.barycentric[index])
        a, b, c = exact.corners(own)
        point = [a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]) for k in range(3)]
    toward = [exact.light[k] - exact.w * point[k] for k in range(3)]

    def volume(p, q):
        """det(toward, p - point, q - point)"""
        p, q = [p[k] - point[k] for k in range(3)], [q[k] - point[k] for k in range(3)]
        return (
            toward[0] * (p[1] * q[2] - p[2] * q[1])
            + toward[1] * (p[2] * q[0] - p[0] * q[2])
            + toward[2] * (p[0] * q[1] - p[1] * q[0])
        )

    a, b, c = exact.corners(t)
    parts = volume(b, c), volume(c, a), volume(a, b)
    return np.array([float(part / sum(parts)) for part in parts])


def rational_shares(scene: Scene, light: Light, samples: ViewSamples) -> NDArray[np.float64]:
    """`(n, 3)` of a flat list: every triangle asked, in rationals; NaN where a cutoff is too near."""
    exact = Exact(scene, light)
    arriving = np.ones((samples.size, 3))
    for index in range(samples.size):
        for t in range(len(scene.triangles)):
            if not exact.shades(samples, index, t, closed=closed(scene, t)):
                continue
            if t == samples.triangle[index]:
                u, v = samples.barycentric[index].astype(float)
                weights = np.array([1 - u - v, u, v])
            else:
                weights = weights_of(exact, samples, index, t)
            arriving[index] *= shares(scene, t, weights)
    return arriving


def check(scene: Scene, light: Light, samples: ViewSamples, method: Frustum | None = None) -> float:
    """Compare a mask with the truth; returns the share of samples that are neither lit nor dark."""
    truth = rational_shares(scene, light, samples)
    known = ~np.isnan(truth).any(axis=-1)
    mask = shadow(scene, light, samples, method=method or Frustum())
    assert mask.guarantee is Guarantee.EXACT and known.mean() > 0.95
    np.testing.assert_array_equal(mask.in_shadow[known], (truth[known] == 0).all(axis=-1))
    np.testing.assert_allclose(mask.transmittance[known], truth[known], rtol=0, atol=1e-5)
    assert ((mask.transmittance == 0).all(axis=-1) == mask.in_shadow).all()
    return float(((truth > 0) & (truth < 1)).any(axis=-1).mean())


@pytest.mark.parametrize("position", LIGHTS)
@pytest.mark.parametrize("kinds", [[0, 1, 2, 5, 6, 8], [3, 4, 7, 1, 0], [1, 2], [5]], ids=str)
@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
def test_every_share_agrees_with_rationals(soup, kinds, position):
    rng = np.random.default_rng(len(kinds))
    light = Light(np.array(position))
    scene = dressed(soup(rng, 12), rng, kinds, colors=soup is lattice_soup and 5 not in kinds)
    partly = 0.0
    for samples in (random_samples(rng, scene, 60), ViewSamples.points(rng.integers(-12, 13, (60, 3)) / 4)):
        partly += check(scene, light, samples)
    assert (partly == 0) == (kinds == [5])
