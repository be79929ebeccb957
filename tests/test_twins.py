"""The shaders' predicate and chances beside the CPU's: the same inputs to both."""

from pathlib import Path

import numpy as np
import pytest

from umbrae.geometry.chance import LIGHT, MOST_STRATA, chances, key_of
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.context import session
from umbrae.gl.program import program

HERE = Path(__file__).parent
pytestmark = pytest.mark.usefixtures("opengl")


def shader_facing(corners, light):
    """`(t,)` what `facing.glsl` says of `corners (t, 3, 3)`."""
    with session().current() as current:
        shader = program(current, HERE / "facing_twin.glsl")
        given = current.moderngl.buffer(corners.astype(np.float32).tobytes())
        found = current.moderngl.buffer(reserve=4 * len(corners))
        given.bind_to_storage_buffer(0)
        found.bind_to_storage_buffer(1)
        shader["count"].value = len(corners)
        shader["light"].value = tuple(float(x) for x in light)
        shader.run(-(-len(corners) // 64))
        current.moderngl.memory_barrier()
        return np.frombuffer(found.read(), np.int32)


def cpu_facing(corners, light):
    triangles = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return facing_of_all(corners.reshape(-1, 3).astype(np.float32), triangles, np.asarray(light, np.float32))


def triangles_of(kind, rng, count=20_000):
    corners = rng.uniform(-1, 1, (count, 3, 3))
    light = np.append(rng.uniform(-1, 1, 3), 1.0)
    if kind == "directional":
        light[3] = 0.0
    elif kind == "nearly edge-on":  # the third corner in the plane of the light and the others, but for rounding
        share = rng.uniform(-2, 2, (count, 2, 1))
        light = light.astype(np.float32).astype(np.float64)
        a, b = corners[:, 0], corners[:, 1]
        corners[:, 2] = a + share[:, 0] * (b - a) + share[:, 1] * (light[:3] - a)
    elif kind == "slivers":
        corners[:, 2] = corners[:, 0] + rng.uniform(0, 1, (count, 1)) * (corners[:, 1] - corners[:, 0])
        corners[:, 2] += rng.normal(0, 1e-7, (count, 3))
    elif kind == "lattice":  # many exactly edge-on, and without area
        corners = rng.integers(-2, 3, (count, 3, 3)).astype(float)
        light = np.array([1.0, 2.0, -1.0, 1.0])
    elif kind == "tiny":
        corners *= 1e-20
        light[:3] *= 1e-20
    elif kind == "light far away":
        light[:3] *= 1e9
    return corners.astype(np.float32), light.astype(np.float32)


@pytest.mark.parametrize(
    "kind", ["point", "directional", "nearly edge-on", "slivers", "lattice", "tiny", "light far away"]
)
def test_facing_is_the_predicate_or_says_edge_on_where_float64_cannot_tell(kind):
    corners, light = triangles_of(kind, np.random.default_rng(5))
    truth, found = cpu_facing(corners, light), shader_facing(corners, light)
    differ = np.flatnonzero(truth != found)
    assert (found[differ] == 0).all(), "a side that is wrong, not left open"
    a, b, c = np.moveaxis(corners[differ].astype(np.float64), 1, 0)
    toward = light[:3].astype(np.float64) - light[3] * a
    value = np.abs((np.cross(b - a, c - a) * toward).sum(axis=1))
    size = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1) * np.linalg.norm(toward, axis=1)
    assert (value <= 2.0**-47 * size).all(), "left open although it is not close"
    assert len(differ) <= {"nearly edge-on": 20, "slivers": 20}.get(kind, 0)


def test_both_sides_and_edge_on_triangles_are_among_the_cases():
    for kind in ("point", "directional", "nearly edge-on", "slivers", "lattice"):
        corners, light = triangles_of(kind, np.random.default_rng(5))
        sides = set(cpu_facing(corners, light).tolist())
        assert sides >= ({-1, 0, 1} if kind == "lattice" else {-1, 1}), kind


def test_float32_alone_would_be_wrong():
    # Otherwise the test above would not need what it tests.
    corners, light = triangles_of("nearly edge-on", np.random.default_rng(5))
    a, b, c = np.moveaxis(corners, 1, 0)
    plain = np.sign((np.cross(b - a, c - a) * (light[:3] - a)).sum(axis=1)).astype(int)
    assert np.count_nonzero(plain != cpu_facing(corners, light)) > 1000


def test_precise_products_are_rounded_by_themselves():
    rng = np.random.default_rng(1)
    factors = rng.uniform(1, 2, (4096, 2)).astype(np.float32)
    with session().current() as current:
        shader = program(current, HERE / "precise_twin.glsl")
        given = current.moderngl.buffer(factors.tobytes())
        found = current.moderngl.buffer(reserve=4 * len(factors))
        given.bind_to_storage_buffer(0)
        found.bind_to_storage_buffer(1)
        shader["count"].value = len(factors)
        shader.run(-(-len(factors) // 64))
        current.moderngl.memory_barrier()
        rests = np.frombuffer(found.read(), np.float32)
    exact = factors.astype(np.float64).prod(axis=1)
    assert np.count_nonzero(exact != exact.astype(np.float32)) > 4000, "the products do not need rounding"
    np.testing.assert_array_equal(rests, 0)


@pytest.mark.parametrize("strata", [1, 2, 7, 16, 64, MOST_STRATA - 1, MOST_STRATA])
@pytest.mark.parametrize("seed", [0, 5, 2**62 + 12345])
def test_chances_are_those_of_the_cpu_to_the_last_bit(strata, seed):
    rng, key = np.random.default_rng(strata), key_of(seed, LIGHT)
    pairs = np.stack([rng.integers(0, 2**31, 4096), rng.integers(0, 2**32, 4096)], axis=1)
    pairs[:64] = pairs[0, 0], 0
    pairs[:64, 1] = np.arange(64)  # some pixel's neighbours, at one triangle
    truth = chances(key, pairs[:, 0].astype(np.int32), pairs[:, 1].copy(), strata)
    with session().current() as current:
        shader = program(current, HERE / "chance_twin.glsl")
        given = current.moderngl.buffer(pairs.astype(np.uint32).tobytes())
        found = current.moderngl.buffer(reserve=8 * len(pairs))
        given.bind_to_storage_buffer(0)
        found.bind_to_storage_buffer(1)
        shader["key"].value = int(key) & 0xFFFFFFFF, int(key) >> 32
        shader["count"].value, shader["strata"].value = len(pairs), strata
        shader.run(len(pairs) // 64)
        current.moderngl.memory_barrier()
        values = np.frombuffer(found.read())
    np.testing.assert_array_equal(values, truth)
    assert len(np.unique(truth)) > 4000 and truth.max() < 1
