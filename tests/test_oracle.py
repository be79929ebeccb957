"""The oracle against rationals alone, and its margins against what happens when samples move."""

import numpy as np
import pytest

from truth import lattice_soup, random_samples, random_soup, rational_truth
from umbrae.light import Light
from umbrae.methods.oracle import Oracle
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

LIGHTS = [(0, 5, 0, 1), (1, 1, 1, 0), (3, -2, 1, 1), (0, 0, 1, 0), (0.1, 0.2, 0.05, 1)]


@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
@pytest.mark.parametrize("position", LIGHTS)
@pytest.mark.parametrize("tree", [True, False])
def test_oracle_agrees_with_rationals(soup, position, tree):
    rng = np.random.default_rng(11)
    scene, light = soup(rng, 25), Light(np.array(position))
    samples = random_samples(rng, scene, 60)
    mask = Oracle(tree=tree).prepare(scene).shadow(light, samples)
    np.testing.assert_array_equal(mask.in_shadow, rational_truth(scene, light, samples))


@pytest.mark.parametrize("position", LIGHTS)
def test_oracle_agrees_with_rationals_on_free_points(position):
    rng = np.random.default_rng(12)
    scene, light = lattice_soup(rng, 25), Light(np.array(position))
    samples = ViewSamples.points(rng.integers(-8, 9, (80, 3)) / 2)
    mask = Oracle().prepare(scene).shadow(light, samples)
    np.testing.assert_array_equal(mask.in_shadow, rational_truth(scene, light, samples))


def test_margin_of_a_point_below_a_square():
    # A square of side 2 at height 1, light straight from above.
    positions = np.array([[-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]], np.float32)
    scene = Scene(positions, np.array([[0, 1, 2], [0, 2, 3]]))
    light = Light.directional((0, -1, 0))
    caster = Oracle().prepare(scene)
    points = ViewSamples.points([[1.01, 0, 0.5], [0.5, 0, -0.49], [0.99, 0, 0.5], [0, 1.02, 0.5], [5, 0, 0]])
    in_shadow = caster.shadow(light, points).in_shadow
    assert in_shadow.tolist() == [False, True, True, False, False]
    # The diagonal cuts the square: half the sqrt(2) * 0.99 of the way to it, 0.01 to the outline; 0.02 above the plane.
    cap = np.hypot(2.0, 2.0) / 100
    np.testing.assert_allclose(caster.margin(light, points, in_shadow), [0.01, cap, 0.01, 0.02, cap], rtol=1e-5)


def test_no_verdict_changes_within_the_margin():
    rng = np.random.default_rng(5)
    scene, light = random_soup(rng, 60), Light.point((0.5, 4.0, 1.0))
    caster = Oracle().prepare(scene)
    points = rng.uniform(-1.2, 1.2, (400, 3)).astype(np.float32)
    samples = ViewSamples.points(points)
    verdict = caster.shadow(light, samples).in_shadow
    margin = caster.margin(light, samples, verdict)
    assert (margin > 0).mean() > 0.5
    for _ in range(20):
        step = rng.normal(size=points.shape)
        step *= 0.999 * margin[:, None] / np.linalg.norm(step, axis=1, keepdims=True)
        moved = caster.shadow(light, ViewSamples.points(points + step)).in_shadow
        # Rounding the moved points to float32 may add 1e-7.
        np.testing.assert_array_equal(moved[margin > 1e-4], verdict[margin > 1e-4])
