"""PyVista's shadows held against exact ones: known pictures, and PyVista itself where it is installed."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

import umbrae as um
from umbrae import cli
from umbrae.bench import pyvista_shadows
from umbrae.bench.pyvista_shadows import darkest_fit, pyvista_mask
from umbrae.errors import GraphicsError

GREY = [100, 100, 100]


def test_the_cut_that_suits_best_is_taken_and_background_left_out():
    lit = np.array([[GREY, GREY, GREY, [0, 0, 0], [0, 0, 255]]], np.uint8)
    shadowed = lit.copy()
    shadowed[0, 0], shadowed[0, 1] = 40, 60
    covered = np.array([[True, True, True, True, True]])
    for truth in ([1, 0, 0, 1, 0], [1, 1, 0, 1, 0], [0, 0, 0, 1, 0]):
        dark, seen = darkest_fit(lit, shadowed, np.array([truth], bool), covered)
        assert seen.tolist() == [[True] * 4 + [False]] and (dark[seen] == np.array(truth, bool)[:4]).all()
    # No cut makes the darker pixel lit and the lighter one dark.
    dark, seen = darkest_fit(lit, shadowed, np.array([[0, 1, 0, 1, 0]], bool), covered)
    assert np.count_nonzero(dark[seen] != [0, 1, 0, 1]) == 1


def test_an_empty_picture_is_no_answer():
    blue = np.full((2, 3, 3), (0, 0, 255), np.uint8)
    with pytest.raises(GraphicsError, match="shows nothing of the scene"):
        darkest_fit(blue, blue, np.zeros((2, 3), bool), np.ones((2, 3), bool))


@pytest.mark.usefixtures("opengl")
def test_without_pyvista_the_table_says_so(monkeypatch, capsys):
    monkeypatch.setattr(pyvista_shadows, "find_spec", lambda wanted: None)
    monkeypatch.setattr(pyvista_shadows, "SIZES", ((48, 36),))
    assert cli.run(["bench", "pyvista", "--scene", "pavilion", "--json"]) == 0
    cells = {cell["row"]: cell for cell in json.loads(capsys.readouterr().out)["cells"]}
    assert cells["pyvista"]["not_run"] == "pyvista is not installed: pip install 'umbrae[pyvista]'"
    assert 0 <= cells["shadow-map"]["counters"]["wrong_ppm"] < 100_000 and cells["shadow-map"]["checked"] > 0


@pytest.mark.skipif(find_spec("pyvista") is None, reason="pyvista is not installed")
def test_pyvista_agrees_on_most_of_a_square_picture():
    floor, cover = [(-3, 0, 3), (3, 0, 3), (0, 0, -4)], [(-1, 1, 1), (1, 1, 1), (0, 1, -1)]
    scene = um.Scene(floor + cover, [(0, 1, 2), (3, 4, 5)])
    camera, light = um.Camera.look_at((1, 6, 4), (0, 0, 0), width=120, height=120), um.Light.directional((0.3, -1, 0.1))
    samples = um.sample(scene, camera)
    truth = um.shadow(scene, light, samples).in_shadow
    dark, seen = pyvista_mask(scene, camera, light, truth, samples.covered)
    assert truth.any() and seen.sum() > 0.95 * samples.covered.sum()
    assert (dark != truth)[seen].mean() < 0.1
