"""Alias-free shadow maps: whatever the grid, the verdicts are exact; `test_contract.py` asks it of the default."""

import numpy as np
import pytest

import umbrae as um
from truth import lattice_soup, random_samples, random_soup, rational_truth
from umbrae import Camera, InputError, Light, Scene, ViewSamples, models, verify
from umbrae.methods import alias_free_map
from umbrae.methods.alias_free_map import AliasFreeMap
from umbrae.methods.light_frame import light_frames
from umbrae.methods.sample_lists import build

GRIDS = (0, 1, 2, 7, 64, 300)
LIGHTS = (
    Light.point((0.3, 2.4, 0.2)),
    Light.point((0.1, 0.05, -0.2)),
    Light.point((1.5, -0.5, 900)),
    Light.directional((-0.3, -1, 0.2)),
    Light.directional((0, -1, 0)),
)


@pytest.mark.parametrize("cells", GRIDS)
def test_any_grid_gives_the_truth(cells):
    rng = np.random.default_rng(11)
    for scene in (random_soup(rng, 60), random_soup(rng, 300, 0.1), lattice_soup(rng, 40)):
        samples = random_samples(rng, scene, 400)
        caster = AliasFreeMap(cells=cells).prepare(scene)
        for light in LIGHTS:
            verdict = verify(scene, light, samples, caster.shadow(light, samples))
            assert verdict.ok and verdict.checked == 400


def test_rationals_say_the_same():
    rng = np.random.default_rng(12)
    scene = lattice_soup(rng, 12)
    samples = random_samples(rng, scene, 150)
    for light in (Light.point((1, 2, 1)), Light.directional((-1, -2, -1)), Light.point((0, 0, 0))):
        mask = AliasFreeMap(cells=5).prepare(scene).shadow(light, samples)
        np.testing.assert_array_equal(mask.in_shadow, rational_truth(scene, light, samples))


@pytest.mark.parametrize("shape", ["ray", "point", "line", "light"])
def test_samples_in_one_cell_or_line_are_right_and_stay_small(shape):
    """The bad case: the light sees them all in one place, or in a line across the view."""
    scene = random_soup(np.random.default_rng(13), 200, 0.3)
    source, count = np.array([0.25, 3.0, 0.5]), 20_000
    along = np.linspace(0, 1, count)[:, None]
    places = {
        "ray": source + along * np.array([0.05, -4.5, -0.3]),
        "point": np.tile([0.1, -0.7, 0.2], (count, 1)),
        "line": np.array([-1.5, -1, -1.5]) + along * np.array([3.0, 0, 3.0]),
        "light": source + 1e-12 * along,
    }
    samples, light = ViewSamples.points(places[shape]), Light.point(source)
    truth = um.shadow(scene, light, samples)
    for cells in (0, 1, 500):
        mask = AliasFreeMap(cells=cells).prepare(scene).shadow(light, samples)
        np.testing.assert_array_equal(mask.in_shadow, truth.in_shadow)
        # Packets of 16 samples, one more for each cell in use, and the grid's own 9 bytes a cell, for up to 6 frames.
        packets = count / 16 + min(count, 2 * max(25, cells))
        assert mask.stats["lists_bytes"] < 420 * packets + 6 * 9 * max(25, cells) ** 2 + 5 * 4 * 4096 * 6


def test_the_grid_spans_the_samples_and_each_leaf_is_in_one_list():
    scene = models.sphere(segments=24, rings=12)
    samples = um.sample(scene, Camera.frame(scene, width=96, height=64))
    source = LIGHTS[3].position.astype(np.float64)
    bounds = scene.bounds.astype(np.float64)
    facing = np.zeros(len(scene.triangles), np.int8)
    frames = light_frames(source, bounds, 1e-6)
    leaves, lists, (grid,) = build(samples, facing, source, frames, (1e-6, 1e-15), 12, np.zeros(samples.size, bool))
    named = leaves.ids[lists.slots, 16:]
    assert sorted(named[named >= 0]) == np.flatnonzero(samples.covered).tolist()
    filled = np.diff(lists.ends)[:-1].reshape(12, 12) > 0
    assert filled[[0, -1]].any(axis=1).all() and filled[:, [0, -1]].any(axis=0).all(), "the grid is fitted"
    assert filled.sum() > 90 and not lists.has(grid.rest) and 0 < grid.margin < 0.01


def test_a_large_picture_goes_band_by_band(monkeypatch):
    scene = models.spheres((2, 2), 600)
    samples, light = um.sample(scene, Camera.frame(scene, width=120, height=90)), models.spheres_light((2, 2))
    whole = AliasFreeMap().prepare(scene).shadow(light, samples)
    monkeypatch.setattr(alias_free_map, "BLOCK", 1000)
    np.testing.assert_array_equal(AliasFreeMap().prepare(scene).shadow(light, samples).in_shadow, whole.in_shadow)


@pytest.mark.parametrize("shift", [3000, 200_000])
def test_far_from_the_origin_leaves_reach_out_of_their_cells(shift):
    """Positions are off by a good part of a cell, or by more than one: then all triangles are asked."""
    near = random_soup(np.random.default_rng(14), 400, 0.1)
    scene = Scene(near.positions + np.float32(shift), near.triangles)
    samples = random_samples(np.random.default_rng(15), scene, 20_000)
    for light in (Light.directional((-0.3, -1, 0.2)), Light.point(np.array([0.5, 3, 0.25]) + shift)):
        truth = um.shadow(scene, light, samples)
        for cells in (20, 200, 1000):
            mask = AliasFreeMap(cells=cells).prepare(scene).shadow(light, samples)
            np.testing.assert_array_equal(mask.in_shadow, truth.in_shadow)


def test_cells_beside_a_triangle_are_left_out():
    """A sliver from corner to corner of the view, whose bounds hold all cells, meets those along the diagonal."""
    scene = Scene([(-4, 1, 4), (4, 1, -4), (4, 1, -4.01), (-4, 0, 4), (4, 0, -4)], [(0, 1, 2)])
    grid = np.stack(np.meshgrid(np.linspace(-4, 4, 100), [0.0], np.linspace(-4, 4, 100)), -1).reshape(-1, 3)
    mask = AliasFreeMap(cells=50).prepare(scene).shadow(Light.directional((0, -1, 0)), ViewSamples.points(grid))
    assert 50 <= mask.stats["tile_frustum_tests"] < 50 * 4


def test_cells_in_shadow_are_left_out():
    """A ground under a roof of many layers: the first one to darken a cell is the last that is asked there."""
    corners, triangles = [(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)], [(0, 1, 2), (0, 2, 3)]
    for layer in range(40):
        height, first = 1 + layer / 16, len(corners)
        corners += [(-9, height, 9), (20, height, 9), (-9, height, -20)]
        triangles.append((first, first + 1, first + 2))
    scene = Scene(corners, triangles)
    uv = np.random.default_rng(3).dirichlet((1, 1, 1), 4000)[:, :2]
    samples = ViewSamples.on_surface(scene, np.arange(4000) % 2, uv, 1)
    mask = AliasFreeMap(cells=16).prepare(scene).shadow(Light.directional((0, -1, 0)), samples)
    assert verify(scene, Light.directional((0, -1, 0)), samples, mask, 500).ok
    # Two grounds, each over half of the cells and the diagonal; the layers over all of them, once or twice.
    assert mask.stats["tile_frustum_tests"] < 16 * 16 * 5 < 16 * 16 * 40


@pytest.mark.parametrize("cells", [-1, 2049, 1.5, "many"])
def test_grids_that_it_does_not_take_are_refused(cells):
    with pytest.raises(InputError, match=r"alias-free-map: cells: wanted (0 to 2048|a whole number), got "):
        AliasFreeMap(cells=cells)
