"""Masks that are wrong on purpose: what the band excuses, and what it does not."""

import numpy as np
import pytest

from umbrae import Guarantee, InputError, Light, Scene, ShadowMask, ViewSamples, verify
from umbrae.methods.oracle import Oracle
from umbrae.verify import Truth

ZENITH = Light.directional((0, -1, 0))
# Under the zenith its volume is the prism x >= 0, z >= 0, x + z <= 2, y <= 1.
PRISM = Scene([(0, 1, 0), (2, 1, 0), (0, 1, 2)], [(0, 2, 1)])


def judge(scene, samples, band, guarantee=Guarantee.BANDED, light=ZENITH):
    """The verdict on a mask in which every sample is wrong."""
    truth = Oracle().prepare(scene).shadow(light, samples).in_shadow
    band = np.broadcast_to(np.float32(band), samples.shape)
    return verify(scene, light, samples, ShadowMask(~truth, guarantee, band))


def test_one_wrong_sample_just_inside_the_band_and_one_just_outside():
    samples = ViewSamples.points([(-0.25, -7, 1), (0.25, -7, 1), (-0.25, -7, 1), (0.25, -7, 1)])
    verdict = judge(PRISM, samples, [0.25, 0.25, 0.2499999, 0.2499999])
    assert (verdict.mismatches, verdict.inside_band, verdict.outside_band, verdict.ok) == (4, 2, 2, False)
    np.testing.assert_allclose(verdict.margin, 0.25, rtol=2.0**-23)
    assert (verdict.margin <= 0.25).all() and verdict.worst_margin == verdict.margin.max()
    assert judge(PRISM, samples, 0.25).ok


def test_only_mismatches_are_looked_at_and_named():
    samples = ViewSamples.points([[(-3, 0, 1), (0.25, -7, 1)], [(0.5, 0, 0.5), (9, 9, 9)]])
    in_shadow = np.array([[False, False], [True, False]])
    verdict = verify(PRISM, ZENITH, samples, ShadowMask(in_shadow, Guarantee.BANDED, np.full((2, 2), 1, np.float32)))
    assert verdict.wrong.tolist() == [1]
    assert (verdict.checked, verdict.mismatches, verdict.inside_band) == (4, 1, 1)
    assert verdict.classes == {"boundary": 1, "facing away": 0}


def test_the_band_is_held_against_faces_and_not_against_changes_of_verdict():
    # A small triangle in the shadow of a large one: its faces change no verdict, and a count may go wrong at them.
    scene = Scene([(-9, 8, -9), (9, 8, -9), (0, 8, 9), (0, 1, 0), (2, 1, 0), (0, 1, 2)], [(0, 1, 2), (3, 4, 5)])
    samples = ViewSamples.points([(-0.125, 0, 1)])
    banded, exact = judge(scene, samples, 0.2), judge(scene, samples, 0.2, Guarantee.EXACT)
    np.testing.assert_allclose(banded.margin, 0.125, rtol=2.0**-23)
    assert banded.ok and not exact.ok
    assert exact.margin[0] > banded.margin[0] and exact.classes == {}


def test_acne_is_not_excused_by_the_sample_lying_on_a_cap():
    samples = ViewSamples.on_surface(PRISM, [0], [(0.25, 0.25)])
    verdict = judge(PRISM, samples, 0.4)
    assert not verdict.ok
    np.testing.assert_allclose(verdict.margin, 0.5, rtol=2.0**-23)
    # Nor by an equal triangle: the two are one surface.
    twice = Scene(PRISM.positions, [(0, 2, 1), (0, 2, 1)])
    assert not judge(twice, samples, 0.4).ok


def test_a_surface_sample_is_measured_where_it_is_and_not_where_it_is_rounded_to():
    # Float32 has steps of 2**-11 here; the sample is 2**-19 from the edge z = 4096, its position on it.
    scene = Scene(np.float32([(4096, 1, 4096), (4098, 1, 4096), (4096, 1, 4098)]), [(0, 2, 1)])
    samples = ViewSamples.on_surface(scene, [0], [(2.0**-20, 0.25)])
    assert samples.position[0, 2] == 4096
    verdict = judge(scene, samples, 0.0)
    np.testing.assert_allclose(verdict.margin, 2.0**-19, rtol=1e-4)
    assert verdict.margin[0] < 2.0**-19 and not verdict.ok


def test_a_truth_is_found_once_and_judges_many_masks():
    samples = ViewSamples.points([(x / 4, -7, z / 4) for x in range(-4, 12) for z in range(-4, 12)])
    truth = Truth.find(PRISM, ZENITH, samples, count=100, seed=5)
    right = Oracle().prepare(PRISM).shadow(ZENITH, samples).in_shadow
    assert len(truth.chosen) == 100 and (truth.in_shadow == right[truth.chosen]).all()
    for in_shadow, guarantee in ((right, Guarantee.EXACT), (~right, Guarantee.EXACT), (~right, Guarantee.BANDED)):
        mask = ShadowMask(in_shadow, guarantee, np.full(samples.shape, 0.25, np.float32))
        first, second = truth.judge(mask), verify(PRISM, ZENITH, samples, mask, count=100, seed=5)
        assert first.mismatches == (0 if in_shadow is right else 100)
        assert (first.inside_band, first.classes) == (second.inside_band, second.classes)
        np.testing.assert_array_equal(first.wrong, second.wrong)
        np.testing.assert_array_equal(first.margin, second.margin)
    with pytest.raises(InputError, match="mask has shape"):
        truth.judge(ShadowMask(right[1:], Guarantee.EXACT))


def test_classes():
    # 0 is a floor, 1 a wall that the light grazes; 2 leans by less than 0.001, 3 by more.
    corners = [(0, 0, 0), (0, 0, 4), (4, 0, 0)]
    for k, lean in enumerate((0, 0.0009, 0.0011)):
        corners += [(9 * k, 5, 9), (9 * k + 4, 5, 9), (9 * k, 6, 9 + lean)]
    scene = Scene(np.float32(corners), np.arange(12).reshape(4, 3))
    triangle, side = [0, 0, 0, 1, 1, 2, 2, 3, 3], [1, -1, 0, 1, 0, 1, -1, 1, -1]
    on_faces = ViewSamples.on_surface(scene, triangle, [(0.25, 0.25)] * 9, side)
    verdict = judge(scene, on_faces, np.inf)
    # Facing away: the floor from below, the wall, the first leaning one from both sides, the last from its dark side.
    assert verdict.classes == {"boundary": 4, "facing away": 5}
    assert judge(scene, ViewSamples.points([(1, -1, 1)]), np.inf).classes == {"boundary": 1, "facing away": 0}
    assert judge(scene, on_faces, np.inf, light=Light.point((1, 9, -700))).mismatches == 9


def test_a_scene_without_faces_forgives_nothing():
    verdict = judge(Scene([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), ViewSamples.points([(0, 0, 1)]), 1e30)
    assert not verdict.ok and verdict.worst_margin == np.finfo(np.float32).max


@pytest.mark.parametrize(
    ("band", "message"),
    [
        (None, "wanted an array for a BANDED mask, got NoneType"),
        (0.5, "wanted an array for a BANDED mask, got float"),
        (np.zeros((2, 1), np.float32), r"wanted \(2,\) float32, got \(2, 1\) float32"),
        (np.zeros(2), r"wanted \(2,\) float32, got \(2,\) float64"),
    ],
)
def test_a_banded_mask_needs_its_band(band, message):
    samples = ViewSamples.points([(0, 0, 0), (0, 5, 0)])
    with pytest.raises(InputError, match=message) as caught:
        verify(PRISM, ZENITH, samples, ShadowMask(np.zeros(2, bool), Guarantee.BANDED, band))
    assert "\n" not in str(caught.value)
    verify(PRISM, ZENITH, samples, ShadowMask(np.zeros(2, bool), Guarantee.EXACT, band))
