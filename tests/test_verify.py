"""Masks that are wrong on purpose: what the band excuses, and what it does not."""

import json

import numpy as np
import pytest

import umbrae as um
from umbrae import Guarantee, InputError, Light, Material, Scene, ShadowMask, ViewSamples, cli, verify
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


# Casters that let light through

PANE = Scene(PRISM.positions, PRISM.triangles, Material((1, 1, 1, 0.5), "BLEND"))
"""As `PRISM`, and half the light passes."""
BELOW = ViewSamples.points([(0.25, -7, 1), (0.5, 0, 0.5), (-0.25, -7, 1), (9, 9, 9)])
SHARES = np.repeat(np.float32([0.5, 0.5, 1, 1])[:, None], 3, axis=1)


def shared(partial, tolerance=1e-5, guarantee=Guarantee.EXACT, band=None, in_shadow=None):
    """A mask with shares of light."""
    partial = np.asarray(partial, np.float32)
    in_shadow = (partial == 0).all(axis=-1) if in_shadow is None else np.asarray(in_shadow)
    return ShadowMask(in_shadow, guarantee, band, partial=partial, tolerance=tolerance)


def test_shares_of_light_may_be_off_by_the_tolerance():
    truth = Truth.find(PANE, ZENITH, BELOW)
    np.testing.assert_array_equal(truth.transmittance, SHARES)
    assert Truth.find(PRISM, ZENITH, BELOW).transmittance is None
    exact = truth.judge(Oracle().prepare(PANE).shadow(ZENITH, BELOW))
    assert (exact.mismatches, exact.worst_transmittance) == (0, 0.0)
    off = SHARES.copy()
    off[1, 2] += 2.0**-12
    for tolerance, wrong in ((2.0**-12, []), (2.0**-12.1, [1]), (0.0, [1])):
        verdict = truth.judge(shared(off, tolerance))
        assert verdict.wrong.tolist() == wrong and verdict.ok == (not wrong)
        assert verdict.worst_transmittance == 2.0**-12
    # Half a triangle's height away from its sides.
    np.testing.assert_allclose(truth.judge(shared(off)).margin, truth.caster.margin(ZENITH, BELOW, truth.in_shadow)[1])


def test_a_mask_that_knows_dark_and_lit_only_is_wrong_below_a_pane():
    for dark in (True, False):
        in_shadow = np.array([dark, dark, False, False])
        verdict = verify(PANE, ZENITH, BELOW, ShadowMask(in_shadow, Guarantee.EXACT))
        assert verdict.wrong.tolist() == [0, 1] and verdict.worst_transmittance == 0.5


def test_the_right_share_does_not_excuse_the_wrong_verdict():
    verdict = verify(PANE, ZENITH, BELOW, shared(SHARES, in_shadow=[True, False, False, False]))
    assert verdict.wrong.tolist() == [0] and verdict.worst_transmittance == 0
    # A trace of light is light, whatever the tolerance.
    dim = Scene(PANE.positions, PANE.triangles, Material((1, 1, 1, 1 - 1e-4), "BLEND"))
    traces = Oracle().prepare(dim).shadow(ZENITH, BELOW).transmittance
    assert 0 < traces[0, 0] < 1e-3
    verdict = verify(dim, ZENITH, BELOW, shared(traces, 1e-3, in_shadow=[True, True, False, False]))
    assert verdict.wrong.tolist() == [0, 1]


def test_shares_in_a_solid_scene_are_all_or_nothing():
    right = Oracle().prepare(PRISM).shadow(ZENITH, BELOW)
    assert verify(PRISM, ZENITH, BELOW, right).worst_transmittance == 0
    off = right.transmittance.copy()
    off[3] = 0.75
    verdict = verify(PRISM, ZENITH, BELOW, shared(off))
    assert verdict.wrong.tolist() == [3] and verdict.worst_transmittance == 0.25


def test_wrong_shares_are_excused_within_the_band_alone():
    off = np.full((4, 3), 1, np.float32)
    verdict = verify(PANE, ZENITH, BELOW, shared(off, 0.0, Guarantee.BANDED, np.float32([0.25, 0.25, 0.25, 0.25])))
    assert (verdict.mismatches, verdict.inside_band, verdict.outside_band) == (2, 1, 1)
    assert verdict.worst_transmittance == 0.5


def test_at_a_cut_off_either_verdict_is_right():
    # Alpha is 0 and 1 at the texels' centres, x = 1/2 and 3/2, and 1/2 half-way.
    texture = np.array([[(0, 0, 0, 0), (0, 0, 0, 255)]], np.uint8)
    uv = [(0, 0), (1, 0), (0, 1)]
    card = Scene(PRISM.positions, PRISM.triangles, Material((1, 1, 1, 1), "MASK", texture=texture), uv=uv)
    samples = ViewSamples.points([(1, 0, 0.25), (0.5, 0, 0.25), (1.5, 0, 0.25)])
    for share in (0, 1):
        partial = np.repeat(np.float32([share, 1, 0])[:, None], 3, axis=1)
        assert verify(card, ZENITH, samples, shared(partial, 0.0)).mismatches == 0
        assert verify(card, ZENITH, samples, shared(1 - partial, 0.0)).wrong.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("partial", "tolerance", "message"),
    [
        (SHARES, 1.1e-3, r"mask.tolerance: wanted a number in \[0, 0.001\], got 0.0011"),
        (SHARES, -1e-9, "mask.tolerance: wanted a number"),
        (SHARES, np.nan, "mask.tolerance: wanted a finite number"),
        (SHARES[:, 0], 0.0, r"mask.partial: wanted \(4, 3\) float32, got \(4,\) float32"),
        (SHARES.astype(np.float64), 0.0, r"mask.partial: wanted \(4, 3\) float32, got \(4, 3\) float64"),
        (SHARES + 1, 0.0, r"mask.partial: wanted numbers in \[0, 1\], got 1.5 to 2"),
        (SHARES * np.float32(np.nan), 0.0, r"mask.partial: wanted numbers in \[0, 1\]"),
        (SHARES.tolist(), 0.0, "mask.partial: wanted ndarray, got list"),
    ],
)
def test_a_mask_does_not_excuse_itself(partial, tolerance, message):
    mask = ShadowMask(np.zeros(4, bool), Guarantee.EXACT, partial=partial, tolerance=tolerance)
    with pytest.raises(InputError, match=message) as caught:
        verify(PANE, ZENITH, BELOW, mask)
    assert "\n" not in str(caught.value)


class AlmostRight(Oracle):
    """Off by half its tolerance, and as much again where it is asked to be wrong."""

    name = "almost-right"
    off = 5e-4

    def prepare(self, scene, clock=None):
        caster = super().prepare(scene, clock)

        def shadow(light, samples, clock=None):
            mask = Oracle().prepare(scene).shadow(light, samples, clock)
            partial = np.where(mask.in_shadow[..., None], 0, np.clip(mask.transmittance, self.off, 1) - self.off)
            return shared(partial, 1e-3, in_shadow=mask.in_shadow)

        caster.shadow = shadow
        return caster


class SolidOnly(AlmostRight):
    name = "solid-only"

    def prepare(self, scene, clock=None):
        if len(scene.triangles) == 4:  # but not the warm-up's
            raise InputError("casters let light through")
        return super().prepare(scene, clock)


def test_the_command_line_names_the_worst_share(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    floor = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]
    roof = [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)]
    pane = Material((1, 1, 1, 0.5), "BLEND")
    faces = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    um.save(Scene(floor + roof, faces, [Material(), pane], [0, 0, 1, 1]), "pane.glb")
    um.save(Scene(floor + roof, faces), "roof.glb")
    for name in list(um.METHODS):
        if name != "oracle":
            monkeypatch.delitem(um.METHODS, name)
    for method in (AlmostRight, SolidOnly):
        monkeypatch.setitem(um.METHODS, method.name, method)
    texts = ["--size", "64x36", "--count", "500", "--sun", "120,40", "--method"]

    def out(model, method, *more, status=0):
        assert cli.run(["verify", model, *texts, method, *more]) == status
        return capsys.readouterr().out

    assert out("pane.glb", "almost-right").endswith("worst margin 0, light off by 0.0005 at most\n")
    assert out("pane.glb", "oracle").endswith("light off by 0 at most\n")
    assert "light off" not in out("roof.glb", "almost-right")
    _, _, heads, almost, solid = out("pane.glb", "all").splitlines()
    assert heads.split() == ["method", "guarantee", "band", "band", "off", "margin", "seconds"]
    assert almost.split()[:5] == ["almost-right", "exact", "0", "0", "0.0005"]
    assert solid == "not judged: solid-only: casters let light through"
    (light,) = json.loads(out("pane.glb", "all", "--json"))["lights"]
    first, second = light["methods"]
    assert first["worst_transmittance"] == pytest.approx(5e-4, rel=1e-3) and first["mismatches"] == 0
    assert second["reason"] == "casters let light through" and "worst_transmittance" not in second
    (light,) = json.loads(out("roof.glb", "almost-right", "--json"))["lights"]
    assert "worst_transmittance" not in light
    monkeypatch.setattr(AlmostRight, "off", 2e-3)
    (light,) = json.loads(out("pane.glb", "almost-right", "--json", status=1))["lights"]
    assert light["outside_band"] > 0 and light["worst_transmittance"] == pytest.approx(2e-3, rel=1e-3)
