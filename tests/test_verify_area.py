"""The truth about lights with a size: every pair of sample and light sample, and masks that are wrong on purpose."""

import json
from dataclasses import replace

import numpy as np
import pytest

from test_area import LAMP, SUN, finely_tessellated
from test_frustum_transmission import both, dressed
from truth import lattice_soup, random_samples, random_soup, rational_transmittance
from umbrae import Guarantee, InputError, Light, Scene, ShadowMask, ViewSamples, cli, shadow, verify
from umbrae.methods import cast_shadow
from umbrae.methods.area_average import average_over_light
from umbrae.methods.area_samples import light_samples
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.oracle import Oracle
from umbrae.verify import Truth


@pytest.mark.parametrize(
    "light", [Light.point((0.3, 2.5, 0.2), radius=1.5), Light.directional((1, -1, 1), angular_diameter=60)]
)
@pytest.mark.parametrize("through", [False, True])
@pytest.mark.parametrize("soup", [lattice_soup, random_soup])
def test_the_oracle_says_what_rationals_say_of_each_light_sample(soup, through, light):
    rng = np.random.default_rng(2)
    scene = soup(rng, 9)
    if through:
        scene = dressed(scene, rng, [0, 1, 2, 4], colors=True)
    samples = random_samples(rng, scene, 20)
    lights, truth = light_samples(light, samples, 5), np.empty((20, 5, 3))
    for index in range(20):
        for number in range(5):
            one = samples.take(np.array([index]))
            truth[index, number] = rational_transmittance(scene, Light(lights[index, number]), one)[0]
    mask, lowest, highest = Oracle(light_samples=5).prepare(scene).decide(light, samples)
    wanted = truth.mean(axis=1).astype(np.float32)
    np.testing.assert_allclose(mask.partial, wanted, rtol=0, atol=1e-6 if through else 0)
    assert (lowest <= mask.partial).all() and (mask.partial <= highest).all()
    np.testing.assert_array_equal(mask.in_shadow, (wanted == 0).all(axis=1))
    assert ((wanted > 0) & (wanted < 1)).mean() > 0.05 and mask.guarantee is Guarantee.EXACT


@pytest.mark.parametrize(
    "light", [Light.point((-2, 7, 1.5), radius=1.5), Light.directional((-1, -2, -0.7), angular_diameter=4)]
)
def test_masks_of_the_frustum_method_are_equal_to_the_truth(light, monkeypatch):
    scene, samples = finely_tessellated()
    verdict = verify(scene, light, samples, shadow(scene, light, samples))
    assert verdict.ok and verdict.mismatches == 0 and verdict.worst_transmittance == 0
    assert verdict.checked == samples.covered.sum()
    other = verify(scene, light, samples, shadow(scene, light, samples, Frustum(light_samples=16)))
    assert other.mismatches > 5, "other light samples are other questions"
    few = Truth.find(scene, light, samples, count=300, seed=1, light_samples=16)
    mask = shadow(scene, light, samples, Frustum(light_samples=16))
    assert few.judge(mask).ok and len(few.chosen) == 300
    monkeypatch.setattr("umbrae.methods.oracle._PAIRS", 100)
    again = Truth.find(scene, light, samples, count=300, seed=1, light_samples=16)
    np.testing.assert_array_equal(again.transmittance, few.transmittance)
    # The mean over light samples that are the same for all is near, and promises nothing.
    mean = verify(scene, light, samples, average_over_light(Oracle().prepare(scene), light, samples, 32))
    assert mean.mismatches > 5 and 0.02 < mean.worst_transmittance < 0.4


def test_one_light_sample_too_many_is_found():
    scene, samples = finely_tessellated()
    mask = shadow(scene, SUN, samples)
    half = np.flatnonzero(np.abs(mask.partial[..., 0].reshape(-1) - 0.5) < 0.2)[:3]
    partial = mask.partial.copy()
    partial.reshape(-1, 3)[half] += np.float32(1 / 32)
    verdict = verify(scene, SUN, samples, replace(mask, partial=partial))
    assert verdict.wrong.tolist() == half.tolist() and not verdict.ok
    assert verdict.worst_transmittance == pytest.approx(1 / 32)
    dark = mask.in_shadow.copy()
    dark.reshape(-1)[half[0]] = True
    assert verify(scene, SUN, samples, replace(mask, in_shadow=dark)).wrong.tolist() == [half[0]]


def test_masks_of_scenes_that_let_light_through():
    rng = np.random.default_rng(4)
    scene = dressed(random_soup(rng, 200), rng, [0, 1, 2, 3, 4, 5, 7, 9])
    samples = both(scene, rng, 300)
    mask = cast_shadow(Frustum(), Frustum().prepare(scene), LAMP, samples)
    verdict = verify(scene, LAMP, samples, mask)
    assert verdict.ok and 0 < verdict.worst_transmittance < 1e-6
    off = mask.partial.copy()
    at = int(np.argmin(np.abs(off[:, 1] - 0.5)))
    off[at, 1] += 3e-5
    assert verify(scene, LAMP, samples, replace(mask, partial=off)).wrong.tolist() == [at]


def test_margins_are_those_of_the_nearest_light_sample():
    # Under the zenith its volume is the prism x >= 0, z >= 0, x + z <= 2, y <= 1.
    prism = Scene([(0, 1, 0), (2, 1, 0), (0, 1, 2), (-99, 0, 0), (99, 0, 0), (99, 0, 0)], [(0, 2, 1), (3, 4, 5)])
    samples = ViewSamples.points([(-0.25, -7, 1), (0.25, -7, 1)])
    for light in (Light.directional((0, -1, 0)), Light.directional((0, -1, 0), angular_diameter=1e-9)):
        truth = Truth.find(prism, light, samples)
        verdict = truth.judge(ShadowMask(~truth.in_shadow, Guarantee.EXACT))
        np.testing.assert_allclose(verdict.margin, 0.25, rtol=1e-6)
    wide = Light.directional((0, -1, 0), angular_diameter=1)
    truth = Truth.find(prism, wide, samples)
    # Eight units down, the edges of half a degree's rays lie up to 0.07 to either side.
    margin = truth.judge(ShadowMask(~truth.in_shadow, Guarantee.EXACT)).margin
    assert ((margin > 0.25 - 0.07) & (margin < 0.25 - 0.05)).all()


def test_what_cannot_be_judged():
    samples = ViewSamples.points([[0, 0, 0]])
    banded = ShadowMask(np.zeros(1, bool), Guarantee.BANDED, np.ones(1, np.float32))
    scene = random_soup(np.random.default_rng(0), 3)
    with pytest.raises(InputError, match="light without a size for a BANDED mask"):
        verify(scene, LAMP, samples, banded)
    with pytest.raises(InputError, match="light_samples: wanted at least 1, got 0"):
        verify(scene, LAMP, samples, ShadowMask(np.zeros(1, bool), Guarantee.EXACT), light_samples=0)


def test_verify_on_the_command_line(tmp_path, capsys):
    model = str(tmp_path / "spheres.glb")
    assert cli.run(["scene", "spheres", "--output", model]) == 0
    small = ["verify", model, "--size", "160x90", "--count", "2000"]
    lit = ["--light", "-2,7,1.5", "--light-radius", "0.5", "--sun", "120,40", "--sun-diameter", "2"]
    capsys.readouterr()
    assert cli.run([*small, *lit, "--light-samples", "16", "--json"]) == 0
    for light in json.loads(capsys.readouterr().out)["lights"]:
        assert (light["checked"], light["mismatches"], light["worst_transmittance"]) == (2000, 0, 0)
    assert cli.run([*small, "--sun", "120,40", "--light-samples", "16"]) != 0
    assert "--light-samples: wanted a light with a size" in capsys.readouterr().err
