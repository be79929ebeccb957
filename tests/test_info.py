"""`umbrae info`: the numbers of soups that can be counted by hand, and of real models if they are there."""

import io
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import umbrae as um
from umbrae import models
from umbrae.info import describe, light_grid, table

REAL = Path(__file__).parents[2] / "shared" / "scenes"

# triangles, edges with one, two and more triangles, badly wound edges, triangles without area, duplicates
COUNTS = {
    "stanford/dragon-100k.obj": (100_000, 0, 150_000, 0, 0, 0, 0),
    "stanford/dragon_vrip_res4.ply": (11_102, 0, 14_993, 803, 0, 0, 502),
    "stanford/bunny.obj": (69_451, 223, 104_065, 0, 0, 0, 0),
    "sponza/sponza.gltf": (262_267, 24_999, 380_743, 80, 0, 1, 70),
    "foliage/smallpine/pine-mask.gltf": (1_650, 980, 1_985, 0, 0, 0, 0),
    "cad/AC14-FZK-Haus.glb": (36_290, 693, 51_474, 1_179, 0, 0, 204),
    "materials/glass-table.glb": (592, 0, 880, 4, 0, 0, 0),
}


def quad(**options):
    return um.Scene([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], [(0, 1, 2), (0, 2, 3)], **options)


def test_open_quad():
    facts = describe(quad())
    assert (facts.triangles, facts.vertices, facts.positions) == (2, 4, 4)
    assert (facts.edges_1, facts.edges_2, facts.edges_more) == (4, 1, 0)
    assert not facts.closed and facts.consistently_wound
    assert facts.degenerate == facts.duplicates == 0
    assert facts.bounds == ((0, 0, 0), (2, 2, 0)) and facts.origin == (0, 0, 0)
    # the 4 open edges always; the diagonal of a flat quad never
    assert facts.silhouette_share == pytest.approx(4 / 5)


def test_sphere_is_closed_and_its_silhouette_thin():
    facts = describe(models.sphere(segments=32, rings=16))
    assert facts.closed and facts.consistently_wound
    assert (facts.edges_1, facts.edges_2, facts.edges_more) == (0, 3 * facts.triangles // 2, 0)
    assert 0.02 < facts.silhouette_share < 0.04


def test_closed_does_not_ask_for_winding():
    sphere = models.sphere(segments=8, rings=4)
    triangles = sphere.triangles.copy()
    triangles[20] = triangles[20][::-1]
    facts = describe(um.Scene(sphere.positions, triangles))
    assert facts.closed and facts.edges_badly_wound == 3 and not facts.consistently_wound


def test_degenerate_and_duplicate_triangles():
    positions = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (0, 0, 0), (1, 0, 0), (0, 1, 0)]
    # a triangle; the same with other indices, turned and flipped; a needle of three points; a point
    facts = describe(um.Scene(positions, [(0, 1, 2), (5, 6, 4), (2, 1, 0), (0, 1, 3), (4, 0, 0)]))
    assert facts.positions == 4
    assert facts.duplicates == 2
    assert facts.degenerate == 2


def test_empty_scene():
    facts = describe(um.Scene([], []))
    assert (facts.triangles, facts.edges_1, facts.silhouette_share) == (0, 0, 0.0)
    assert facts.bounds == ((0, 0, 0), (0, 0, 0))


def test_bounds_are_in_the_files_coordinates():
    corner = np.array([5_300_000.25, 400.5, 120_000.125])
    with pytest.warns(um.RecentredWarning):
        scene = um.Scene(corner + np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0.1)]), [(0, 1, 2)])
    facts = describe(scene)
    assert facts.bounds[0] == pytest.approx(corner, abs=1e-6, rel=0)
    assert any(facts.origin)


def test_materials_and_memory():
    texture = np.zeros((2, 3, 3), np.uint8)
    red = um.Material((1, 0, 0, 0.5), alpha_mode="BLEND", name="red", texture=texture)
    glass = um.Material(transmission=0.75, double_sided=False)
    plain, dressed = describe(quad()), describe(quad(materials=[red, glass], material_id=[1, 1]))
    assert [material.triangles for material in dressed.materials] == [0, 2]
    assert dressed.materials[0].texture_px == (3, 2)
    assert dressed.scene_bytes - plain.scene_bytes == 2 * 3 * 4
    assert plain.scene_bytes == 4 * 12 + 2 * 12 + 2 * 4 + 2 * 4
    samples = um.ViewSamples.points(np.zeros((10, 3)))
    arrays = (samples.triangle, samples.barycentric, samples.side, samples.position, samples.covered)
    assert plain.samples_bytes == 1920 * 1080 * (sum(array.nbytes for array in arrays) // 10 + 4 + 1)


def test_lights_surround_the_scene():
    lights = light_grid(quad())
    assert lights.shape == (64, 4) and (lights[:, 3] == 1).all()
    assert lights[:, :3].min(axis=0) == pytest.approx((-2, -2, -3))
    assert lights[:, :3].max(axis=0) == pytest.approx((4, 4, 3))


def test_table_fits_80_columns_and_the_dictionary_is_json():
    long = um.Material(name="a material with quite a long name " * 3, alpha_mode="MASK", transmission=0.123456)
    facts = describe(quad(materials=[long]))
    stream = io.StringIO()
    Console(width=80, file=stream).print(table(facts))
    lines = stream.getvalue().splitlines()
    assert max(len(line.rstrip()) for line in lines) <= 80
    assert any(line.startswith("edges") and "4 with one triangle" in line for line in lines)
    assert json.loads(json.dumps(facts.as_dict()))["consistently_wound"] is True


@pytest.mark.parametrize("name", [name for name in COUNTS if (REAL / name).exists()])
def test_real_models(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", um.RecentredWarning)
        facts = describe(um.load(REAL / name))
    found = (facts.triangles, facts.edges_1, facts.edges_2, facts.edges_more)
    assert (*found, facts.edges_badly_wound, facts.degenerate, facts.duplicates) == COUNTS[name]
    if name.startswith("sponza"):
        assert facts.silhouette_share == pytest.approx(0.15, abs=0.005)
