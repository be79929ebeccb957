"""Sharp truths that need no oracle: a closed convex mesh under a light outside it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from umbrae import METHODS, Light, Scene, ViewSamples
from umbrae.methods.oracle import Exact

POINTS = [name for name, method in METHODS.items() if "points" in method.accepts]
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def octasphere(levels: int) -> Scene:
    """An octahedron subdivided and pushed outwards: closed, outward, convex up to the rounding of its vertices."""
    corners = [np.array(v, float) for v in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1))]
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    triangles = [[corners[i] for i in face] for face in faces]
    for _ in range(levels):
        finer = []
        for a, b, c in triangles:
            ab, bc, ca = ((p + q) / np.linalg.norm(p + q) for p, q in ((a, b), (b, c), (c, a)))
            finer += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        triangles = finer
    return Scene(np.array(triangles, np.float32).reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def samples_everywhere(scene: Scene, rng: np.random.Generator, count: int) -> ViewSamples:
    """Outward-seen samples on faces, edges and corners."""
    uv = rng.integers(0, 17, (count, 2)) / 16
    uv[:, 1] = np.minimum(uv[:, 1], 1 - uv[:, 0])
    return ViewSamples.on_surface(scene, rng.integers(0, len(scene.triangles), count), uv, 1)


@pytest.mark.parametrize("method", POINTS)
@settings(max_examples=40)
@given(
    place=st.tuples(*[st.integers(-40, 40)] * 3),
    directional=st.booleans(),
    seed=st.integers(0, 1000),
    fine=st.booleans(),
)
def test_light_facing_samples_are_lit_and_all_others_dark(method, place, directional, seed, fine):
    scene = octasphere(2) if fine else Scene(CUBE.astype(np.float32), CUBE_FACES)
    place = np.array(place, float) / 8
    if directional:
        if not place.any():
            return
        light = Light.directional(-place)
    else:
        if np.abs(place).max() <= 1.0:
            return  # inside
        light = Light.point(place)
    samples = samples_everywhere(scene, np.random.default_rng(seed), 200)
    exact = Exact(scene, light)
    facing = np.array([exact.facing(t) for t in range(len(scene.triangles))])[samples.triangle]
    mask = METHODS[method]().prepare(scene).shadow(light, samples)
    # An edge-on face is neither: its samples see the light along their own surface, unless another face hides it.
    np.testing.assert_array_equal(mask.in_shadow[facing > 0], False)
    np.testing.assert_array_equal(mask.in_shadow[facing < 0], True)
