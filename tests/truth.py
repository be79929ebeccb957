"""The definition in rational numbers, asked for every pair of sample and triangle: slow, and nothing to hide behind."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.light import Light
from umbrae.material import Material
from umbrae.methods.oracle import Exact
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import project
from umbrae.scene import Scene


def rational_truth(scene: Scene, light: Light, samples: ViewSamples) -> NDArray[np.bool_]:
    """`(...) bool` in the samples' shape: where no light of any colour arrives."""
    verdict: NDArray[np.bool_] = (rational_transmittance(scene, light, samples) == 0).all(axis=-1)
    return verdict


def rational_transmittance(scene: Scene, light: Light, samples: ViewSamples) -> NDArray[np.float64]:
    """`(..., 3) float64`: the share of light that arrives per colour channel, exact but for one rounding."""
    exact = Exact(scene, light)
    flat = samples.take(np.arange(samples.size))
    solid = [is_solid(scene, t) for t in range(len(scene.triangles))]
    left = np.ones((samples.size, 3))
    for index in np.flatnonzero(flat.covered).tolist():
        if any(exact.shades(flat, index, t) for t, whole in enumerate(solid) if whole):
            left[index] = 0
            continue
        shares = [Fraction(1)] * 3
        for t, whole in enumerate(solid):
            closed = leaves_holes(scene.materials[scene.material_id[t]])
            if not whole and exact.shades(flat, index, t, closed):
                shares = [a * b for a, b in zip(shares, share(scene, light, flat, index, t), strict=True)]
        left[index] = [float(share) for share in shares]
    return left.reshape(*samples.shape, 3)


def leaves_holes(material: Material) -> bool:
    """Opaque, but not everywhere there."""
    return material.alpha_mode == "MASK" and material.transmission == 0


def is_solid(scene: Scene, t: int) -> bool:
    """Whether a triangle lets nothing through with any texel and vertex colour: then nowhere else either."""
    material = scene.materials[scene.material_id[t]]
    texels = [None] if material.texture is None else [*np.unique(material.texture.reshape(-1, 4), axis=0)]
    tints = [None] if scene.colors is None else [*scene.colors[scene.triangles[t]]]
    return not any(any(lets_through(material, factors(texel, tint))) for texel, tint in product(texels, tints))


def factors(texel: NDArray[np.uint8] | None, tint: NDArray[np.float32] | None) -> list[Fraction]:
    """What a texel and a vertex colour make of red, green, blue and alpha."""
    found = [Fraction(1)] * 4
    if texel is not None:
        found = [linear(int(value)) for value in texel[:3]] + [Fraction(int(texel[3]), 255)]
    if tint is not None:
        found = [a * Fraction(float(b)) for a, b in zip(found, tint, strict=True)]
    return found


def linear(value: int) -> Fraction:
    """An 8-bit sRGB value as linear light, to float64's precision."""
    coded = value / 255
    return Fraction(coded / 12.92 if coded <= 0.04045 else math.pow((coded + 0.055) / 1.055, 2.4))


def lets_through(material: Material, factor: list[Fraction]) -> list[Fraction]:
    """`(1 - a) + a t c`, where base colour and alpha are multiplied by `factor`."""
    red, green, blue, a = (Fraction(base) * by for base, by in zip(material.base_color, factor, strict=True))
    if material.alpha_mode == "OPAQUE":
        a = Fraction(1)
    if material.alpha_mode == "MASK":
        a = Fraction(a >= Fraction(material.alpha_cutoff))
    return [(1 - a) + a * Fraction(material.transmission) * c for c in (red, green, blue)]


def share(scene: Scene, light: Light, samples: ViewSamples, index: int, t: int) -> list[Fraction]:
    """What a caster lets through where the light of a sample crosses it."""
    material = scene.materials[scene.material_id[t]]
    weights = crossing(scene, light, samples, index, t)
    factor = [Fraction(1)] * 4
    if material.texture is not None and scene.uv is not None:
        height, width = material.texture.shape[:2]
        u, v = between(weights, scene.uv[scene.triangles[t]])
        x, y = u * width - Fraction(1, 2), v * height - Fraction(1, 2)
        factor = [Fraction(0)] * 4
        for column, row in product((math.floor(x), math.floor(x) + 1), (math.floor(y), math.floor(y) + 1)):
            weight = (1 - abs(x - column)) * (1 - abs(y - row))
            texel = factors(material.texture[row % height, column % width], None)
            factor = [sum_ + weight * part for sum_, part in zip(factor, texel, strict=True)]
    elif material.texture is not None:
        factor = factors(material.texture[0, 0], None)
    if scene.colors is not None:
        tint = between(weights, scene.colors[scene.triangles[t]])
        factor = [a * b for a, b in zip(factor, tint, strict=True)]
    return lets_through(material, factor)


def between(weights: list[Fraction], corners: NDArray[np.float32]) -> list[Fraction]:
    """Values `(3, k)` of a triangle's corners, interpolated."""
    return [
        sum((w * Fraction(float(x)) for w, x in zip(weights, column, strict=True)), Fraction(0)) for column in corners.T
    ]


def crossing(scene: Scene, light: Light, samples: ViewSamples, index: int, t: int) -> list[Fraction]:
    """Barycentrics of the point in which the ray from a sample to the light meets a triangle's plane."""
    own = int(samples.triangle[index])
    point = rational(samples.position[index])
    if own >= 0:
        u, v = rational(samples.barycentric[index])
        a, b, c = (rational(corner) for corner in scene.positions[scene.triangles[own]])
        if own == t:
            return [1 - u - v, u, v]
        point = a + u * (b - a) + v * (c - a)
    *source, w = rational(light.position)
    toward = np.array(source) - w * point
    a, b, c = (rational(corner) for corner in scene.positions[scene.triangles[t]])
    normal = np.cross(b - a, c - a)
    place = point + toward * (normal.dot(a - point) / normal.dot(toward))
    area = normal.dot(normal)
    return [normal.dot(np.cross(second - first, place - first)) / area for first, second in ((b, c), (c, a), (a, b))]


def rational(values: NDArray[np.float32]) -> NDArray[np.object_]:
    """The same numbers as fractions."""
    return np.array([Fraction(float(value)) for value in values], object)


def random_soup(rng: np.random.Generator, count: int, size: float = 0.4) -> Scene:
    """Triangles of random place and shape in a cube of side 2."""
    centers = np.repeat(rng.uniform(-1, 1, (count, 3)), 3, axis=0)
    return Scene(
        (centers + rng.uniform(-size, size, (3 * count, 3))).astype(np.float32),
        np.arange(3 * count).reshape(-1, 3),
    )


def lattice_soup(rng: np.random.Generator, count: int) -> Scene:
    """Triangles on a small integer lattice, full of coincidences: shared edges, coplanar and degenerate ones."""
    return Scene(rng.integers(-3, 4, (3 * count, 3)).astype(np.float32), np.arange(3 * count).reshape(-1, 3))


def random_samples(rng: np.random.Generator, scene: Scene, count: int) -> ViewSamples:
    """Sensors on random faces, many of them on edges and corners, seen from random sides (also from none)."""
    uv = rng.integers(0, 9, (count, 2)) / 8
    uv[:, 1] = np.minimum(uv[:, 1], 1 - uv[:, 0])
    triangle = rng.integers(0, len(scene.triangles), count)
    return ViewSamples.on_surface(scene, triangle, uv, rng.integers(-1, 2, count))


def in_picture(scene: Scene, camera: Camera) -> NDArray[np.float64]:
    """Homogeneous pixel coordinates `(v, 3)` of all vertices, rounded as the sampler rounds them."""
    m, p = project(scene, camera).matrix, scene.positions.astype(np.float64)
    return np.stack([row[0] * p[:, 0] + row[1] * p[:, 1] + row[2] * p[:, 2] + row[3] for row in m], axis=1)
