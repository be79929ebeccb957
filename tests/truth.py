"""The definition in rational numbers, asked for every pair of sample and triangle: slow, and nothing to hide behind."""

import numpy as np
from numpy.typing import NDArray

from umbrae.light import Light
from umbrae.methods.oracle import Exact
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


def rational_truth(scene: Scene, light: Light, samples: ViewSamples) -> NDArray[np.bool_]:
    """`(...) bool` in the samples' shape."""
    exact = Exact(scene, light)
    flat = samples.take(np.arange(samples.size))
    verdict = np.zeros(samples.size, bool)
    for index in np.flatnonzero(flat.covered):
        verdict[index] = any(exact.shades(flat, int(index), t) for t in range(len(scene.triangles)))
    return verdict.reshape(samples.shape)


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
