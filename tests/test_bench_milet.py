"""The tables of Milet et al.: their figures, their scenes, and commands that measure small ones whole."""

import dataclasses
import json

import numpy as np
import pytest

import umbrae as um
from umbrae import cli, models
from umbrae.bench import milet, milet_paper
from umbrae.bench.by_object import ByObject, GsByObject, TsByObject
from umbrae.bench.milet import Effort
from umbrae.bench.milet_scenes import (
    box_and_sphere,
    facing_views,
    grid_of,
    spheres_views,
    sponza_views,
    without_textures,
)
from umbrae.bench.sweep import TIME, Cell, SweepRecord
from umbrae.clock import Clock
from umbrae.geometry.edges import edges, weld
from umbrae.mask import Guarantee
from umbrae.methods import make_method

SIZE = (32, 24)


def told(rows, row, device, quantity=TIME):
    (one,) = [one for one in rows if (one.row, one.device, one.quantity) == (row, device, quantity.name)]
    return one.values


def test_the_papers_frames_a_second_are_milliseconds_for_each_quantity():
    rows = milet_paper.rows_of(milet_paper.RESOLUTION)
    for quantity in (TIME, milet_paper.OPENGL):
        assert told(rows, "TS", "R9 280X", quantity)["800x600"] == pytest.approx(1000 / 130, abs=1e-4)
        assert told(rows, "GS, 3 edges", "GTX 680", quantity)["1920x1080"] == pytest.approx(1000 / 60, abs=1e-4)
    assert len(rows) == 2 * 2 * 4 and all(len(one.values) == 4 for one in rows)


def test_no_table_lacks_a_number_and_zeros_are_none():
    four = (milet_paper.TEXTURES, milet_paper.SPHERES, milet_paper.BOX, milet_paper.MILLION)
    for text in (*four, milet_paper.HUNDRED_THOUSAND):
        rows = milet_paper.rows_of(text)
        assert {len(one.values) for one in rows} == {len(milet_paper.columns_of(text))}
    overall = milet_paper.rows_of(milet_paper.OVERALL, order=milet_paper.OVERALL_ORDER)
    assert told(overall, "SM", "GTX 680") == {"4000000": pytest.approx(1000 / 74, abs=1e-4)}
    assert told(overall, "GS", "GTX 680")["4000000"] == pytest.approx(1000 / 14.8, abs=1e-4)


def test_rates_stay_as_they_are():
    rows = milet_paper.rows_of(milet_paper.INVISIBLE, quantities=milet_paper.SPEED_UPS)
    assert told(rows, "TS", "GTX 680", milet_paper.SPEED_UPS[1]) == {"1x1": 1.25, "50x50": 5.04}


@pytest.mark.parametrize(
    ("count", "grid"), [(1, (1, 1)), (240, (15, 16)), (851, (23, 37)), (3116, (41, 76)), (15600, (120, 130))]
)
def test_spheres_stand_in_rows_as_square_as_can_be(count, grid):
    assert grid_of(count) == grid


def test_a_sphere_over_a_box_is_two_closed_solids_of_the_papers_triangles():
    scene = box_and_sphere(336)
    assert len(scene.triangles) == 336 and (np.bincount(scene.object_id) == (12, 324)).all()
    topology = edges(weld(scene.positions)[scene.triangles])
    assert (topology.count == 2).all()
    assert scene.positions[scene.triangles[scene.object_id == 0]][..., 1].max() == 0.0


@pytest.mark.parametrize("grid", [(1, 1), (10, 10), (50, 50)])
def test_flights_stay_out_of_the_spheres_and_see_some(grid):
    scene = models.spheres(grid, 8 * grid[0] * grid[1] + 2)
    views = spheres_views(grid, 9, SIZE)
    assert len(views) == 9 and all(view.camera.eye[1] > 2.5 for view in views)
    seen = [um.sample(scene, view.camera) for view in views]
    assert all((samples.triangle >= 2).any() for samples in seen)


def test_sponza_is_flown_through_in_forty_seconds():
    roof = um.Scene([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1, 2)])
    views = sponza_views(roof, 3, SIZE)
    assert views[0].camera.eye == pytest.approx((-1050, 120, 0)) and views[-1].camera.eye == pytest.approx(
        (200, 650, -250)
    )


def test_one_view_has_all_of_the_scene_and_the_other_nothing():
    scene = models.spheres((3, 3), 900)
    for away in (False, True):
        for view in facing_views(scene, (3, 3), 2, SIZE, away):
            x, y, w = view.camera.world_to_clip @ np.vstack([scene.positions.T, np.ones(len(scene.positions))])
            assert (w < 0).all() if away else (w > np.maximum(np.abs(x), np.abs(y))).all()
            assert bool(um.sample(scene, view.camera).covered.any()) is not away


def test_textures_are_taken_off_and_nothing_else():
    pavilion = models.pavilion()
    plain = without_textures(pavilion)
    assert any(one.texture is not None for one in pavilion.materials)
    assert all(one.texture is None for one in plain.materials)
    assert (plain.triangles == pavilion.triangles).all() and (plain.object_id == pavilion.object_id).all()


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize(("method", "plain"), [(TsByObject, "silhouette-ts"), (GsByObject, "silhouette-gs")])
@pytest.mark.parametrize("culling", [False, True])
def test_object_by_object_the_mask_is_the_same(method, plain, culling, monkeypatch):
    scene = models.spheres((4, 3), 1200)
    view = spheres_views((4, 3), 1, SIZE)[0]
    samples = um.sample(scene, view.camera)
    options = {"counting": "zfail", "counter": "stencil", "culling": culling}
    calls = []
    sort = ByObject._sort
    monkeypatch.setattr(ByObject, "_sort", lambda *args: calls.append(sort(*args)) or calls[-1])
    caster = method(**options).prepare(scene)
    for _ in range(2):
        mask = caster.shadow(view.light, samples)
        whole = make_method(plain, **options).prepare(scene).shadow(view.light, samples)
        assert (mask.in_shadow == whole.in_shadow).all() and mask.in_shadow.any()
    if not culling:
        # Twelve spheres and the ground, whose open edges are patches of another size.
        assert sorted(len(one) for one in calls) == ([1, 13] if method is TsByObject else [13])


@pytest.mark.usefixtures("opengl")
def test_a_table_of_spheres_holds_both_methods_and_determinisms(monkeypatch):
    monkeypatch.setattr(milet, "QUICK_SIZE", SIZE)
    record = milet.run_spheres(["10x10", "box"], Effort(frames=2, most=1400), Clock())
    assert record.sweep.columns == ("box 336", "box 1308") and not record.broken
    assert record.rows == ("TS", "TS, 3 edges", "GS", "GS, 3 edges", "frustum")
    for cell in record.cells:
        assert cell.not_run is None and len(cell.seconds) == 2 and cell.checked > 0 and cell.wrong == 0
        assert ("opengl_ns" in cell.counters) is (cell.row != "frustum")
        assert cell.guarantee == {"TS": "banded", "GS": "banded", "frustum": "exact"}.get(cell.row, "none")
    assert record.paper_ratio("GS", "box 336", "R9 280X") == pytest.approx(3010 / 2750, abs=1e-3)


@pytest.mark.usefixtures("opengl")
def test_views_of_nothing_are_compared_with_views_of_all(monkeypatch):
    monkeypatch.setattr(milet, "QUICK_SIZE", SIZE)
    record = milet.run_invisible(Effort(frames=1, most=20_002), Clock())
    # Whether any is broken is not asked: at this size faces are narrower than the band can tell (docs/volumes.md).
    assert record.sweep.columns == ("1x1", "50x50")
    for cell in record.cells:
        assert cell.not_run is None and cell.counters["speed_up_ppm"] > 0 and cell.counters["opengl_speed_up_ppm"] > 0
        assert cell.value(milet_paper.SPEED_UPS[0]) == cell.counters["speed_up_ppm"] / 1e6


def test_a_wrong_sample_in_either_view_breaks_the_row():
    seen, away = (Cell("TS", name, "banded", (3.0,), {"opengl_ns": 8}, 5) for name in ("1x1", "1x1 away"))
    away = dataclasses.replace(away, seconds=(1.5,), counters={"opengl_ns": 2}, wrong=1)
    cell = milet._speed_up(SweepRecord.of(milet._sweep("", "", "7", "", ["1x1"], ()), [seen, away]), "TS", "1x1")
    assert cell.counters == {"speed_up_ppm": 2_000_000, "opengl_speed_up_ppm": 4_000_000}
    assert (cell.checked, cell.wrong, cell.broken, cell.seconds) == (10, 1, True, (3.0,))


def test_views_that_cannot_be_made_are_told(monkeypatch):
    monkeypatch.setattr(milet, "QUICK_SIZE", SIZE)
    rows = {"TS": make_method("frustum")}
    monkeypatch.setattr(milet, "silhouettes", lambda: rows)
    monkeypatch.setattr(milet, "make_method", lambda *_, **__: rows["TS"])
    record = milet.run_invisible(Effort(frames=1, most=1000), Clock())
    small, large = (record.cells[i] for i in (0, 2))
    assert small.row == "TS" and small.guarantee == str(Guarantee.EXACT) and list(small.counters) == ["speed_up_ppm"]
    assert "wanted 20002 to" in str(large.not_run)


@pytest.fixture
def short(tmp_path, monkeypatch):
    """Tiny pictures, no models, one tiny method in place of all."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("UMBRAE_MODELS", str(tmp_path))
    monkeypatch.setattr(milet, "QUICK_SIZE", SIZE)
    monkeypatch.setattr(milet, "as_paper", lambda *_, **__: make_method("frustum"))
    monkeypatch.setattr(milet, "make_method", lambda *_, **__: make_method("frustum"))
    monkeypatch.setattr(milet, "TsByObject", lambda **_: make_method("frustum"))
    monkeypatch.setattr(milet, "GsByObject", lambda **_: make_method("frustum"))


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("command", "columns"),
    [
        ("milet-resolution", ["800x600", "1024x768"]),
        ("milet-textures", ["tex", "notex"]),
        ("milet-spheres --most 1400", ["box 336", "box 1308"]),
        ("milet-objects --scene 100k --most 1000", []),
        ("milet-shadow-map --most 33000", ["32400"]),
        ("milet-overall --most 1400", ["spheres 1400", "sponza"]),
    ],
)
def test_commands_print_one_json_object(capsys, command, columns):
    assert cli.run(["bench", *command.split(), "--frames", "1", "--json"]) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["benchmark"] == command.split()[0] and document["sweep"]["columns"] == columns
    assert err == ""
    sponza = [cell["not_run"] for cell in document["cells"] if cell["column"] in ("800x600", "tex", "sponza")]
    assert all("model sponza/sponza.gltf not found" in str(reason) for reason in sponza)


@pytest.mark.usefixtures("short")
def test_a_table_is_printed_and_kept(capsys, tmp_path):
    assert cli.run(["bench", "milet-shadow-map", "--most", "33000", "--frames", "1", "-o", "a.json"]) == 0
    out = capsys.readouterr().out
    assert "Table 6" in out and "TS / SM" in out and "inferred" in out and (tmp_path / "a.json").exists()
    assert max(len(line) for line in out.splitlines()) <= 80


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("milet-spheres --scene sponza", "unknown scene 'sponza' (known: 10x10, box)"),
        ("milet-resolution --models nowhere", "--models: nowhere is not a folder"),
        ("milet-overall -o a.txt", "unknown extension '.txt', wanted one of .json"),
        ("milet-objects --frames 0", "'--frames': Input should be greater"),
    ],
)
def test_bad_options_end_in_one_line(capsys, command, message):
    assert cli.run(["bench", *command.split()]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("umbrae: error: ")]
    assert len(lines) == 1 and message in lines[0]
