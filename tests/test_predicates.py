"""The predicate and its parts against rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truth import lattice_soup, random_samples, random_soup
from umbrae.geometry import predicates
from umbrae.geometry.expansion import MAX_TERMS, dot_sign, two_product, two_sum
from umbrae.light import Light
from umbrae.methods.oracle import Exact

LARGEST = float(np.nextafter(np.float32(1e18), np.float32(0)))
single = st.floats(-LARGEST, LARGEST, width=32)


@given(st.floats(-1e30, 1e30), st.floats(-1e30, 1e30))
def test_two_sum_loses_nothing(a, b):
    total, error = two_sum(a, b)
    assert Fraction(total) + Fraction(error) == Fraction(a) + Fraction(b)


@given(single, single, single, single)
def test_two_product_loses_nothing(a, b, c, d):
    x, y = float(a) * float(b), float(c) * float(d)
    product, error = two_product(x, y)
    assert Fraction(product) + Fraction(error) == Fraction(a) * Fraction(b) * Fraction(c) * Fraction(d)


@given(st.lists(single, min_size=12, max_size=12), st.lists(single, min_size=12, max_size=12))
def test_dot_sign_is_the_sign_of_the_exact_dot_product(first, second):
    a, b = np.zeros((3, MAX_TERMS)), np.zeros((3, MAX_TERMS))
    a[:, :4], b[:, :4] = np.reshape(first, (3, 4)), np.reshape(second, (3, 4))
    exact = sum(
        sum(map(Fraction, a[axis, :4].tolist())) * sum(map(Fraction, b[axis, :4].tolist())) for axis in range(3)
    )
    assert dot_sign(a, 4, b, 4) == (exact > 0) - (exact < 0)


def test_dot_sign_sees_what_rounding_hides():
    a, b = np.zeros((3, MAX_TERMS)), np.zeros((3, MAX_TERMS))
    a[0, :3] = 1e18, 2.0**-100, -1e18
    b[0, 0] = -1.0
    assert (1e18 + 2.0**-100) - 1e18 == 0.0
    assert dot_sign(a, 3, b, 1) == -1


LIGHTS = [
    (0, 5, 0, 1),
    (1, 1, 1, 0),
    (3, -2, 1, 1),
    (0, 0, 1, 0),
    (0.1, 0.2, 0.05, 1),
    (1e6, 2e6, 1e5, 1),
    (0, 0, 0, 1),
]


@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
@pytest.mark.parametrize("position", LIGHTS)
def test_predicate_agrees_with_rationals_for_every_pair(soup, position):
    rng = np.random.default_rng(7)
    scene, light = soup(rng, 20), Light(np.array(position))
    samples = random_samples(rng, scene, 60)
    exact, source, point = Exact(scene, light), light.position.astype(np.float64), np.empty(3)
    used_exact = 0
    for t in range(len(scene.triangles)):
        facing = predicates.facing(scene.positions, scene.triangles, t, source)
        assert facing == exact.facing(t)
        for i in range(samples.size):
            own = int(samples.triangle[i])
            # The predicate may be asked about any triangle that the light is not in the plane of, but the own one.
            if facing == 0 or t == own:
                continue
            u, v = (float(x) for x in samples.barycentric[i])
            for closed in (True, False):
                flags = predicates.shadows(
                    scene.positions, scene.triangles, t, facing, source, own, u, v, int(samples.side[i]), point, closed
                )
                used_exact += bool(flags & predicates.EXACT)
                if not predicates.same_triangle(scene.positions, scene.triangles, own, t):
                    assert bool(flags & predicates.SHADOWED) == exact.shades(samples, i, t, closed), (t, i)
    if soup is lattice_soup:
        assert used_exact > 0, "a lattice without a single tie tests nothing"


def test_edge_order_does_not_change_a_side_plane():
    scene = random_soup(np.random.default_rng(3), 30)
    light, point = np.array([3.0, 5.0, -2.0, 1.0]), np.array([0.3, -0.2, 0.9])
    for i, j in scene.triangles[:, :2]:
        value, bound = predicates.side_value(scene.positions, i, j, light, point, 1.0)
        other, other_bound = predicates.side_value(scene.positions, j, i, light, point, 1.0)
        assert value == -other
        assert bound == other_bound


def test_same_triangle_in_all_orders():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    for order, same in [
        ((3, 4, 5), True), ((4, 5, 3), True), ((5, 3, 4), True),
        ((4, 3, 5), True), ((3, 5, 4), True), ((5, 4, 3), True),
        ((3, 4, 6), False), ((3, 3, 4), False),
    ]:  # fmt: skip
        triangles = np.array([[0, 1, 2], order], np.int32)
        assert predicates.same_triangle(positions, triangles, 0, 1) == same
