"""`umbrae bench sintorn-...`: the tables of a paper on scenes of a few triangles."""

import json

import numpy as np
import pytest

import umbrae as um
from umbrae import cli, models
from umbrae.bench import sintorn_flythrough, sintorn_layers, sintorn_memory, sintorn_variants
from umbrae.bench.scenes import SCENES, BenchScene
from umbrae.bench.sintorn_flythrough import OPERATIONS, run_flythrough
from umbrae.bench.sintorn_memory import BUFFERS, MEMORY, PER_SAMPLE, run_memory
from umbrae.bench.sintorn_variants import LEAVES, over_ground, run_variants, with_leaves
from umbrae.bench.sweep import TIME, SweepRecord
from umbrae.clock import Clock
from umbrae.models.builder import Builder
from umbrae.sampling import sample_layers
from umbrae.transmission import EVEN, SOLID, VARYING, transmission_of

FLIGHT = (((-6, 5, 6), (0, 0, 0)), ((0, 4, 7), (0, 0, 0)), ((6, 5, 6), (0, 0, 0)))


@pytest.fixture(autouse=True)
def tiny(monkeypatch, tmp_path):
    """A flight over few spheres and one over a model that is not there; a card for a tree."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("UMBRAE_MODELS", raising=False)
    monkeypatch.setitem(SCENES, "few", BenchScene(lambda: models.spheres((3, 3), 900), point=models.spheres_light))
    monkeypatch.setitem(SCENES, "gone", BenchScene("gone.glb"))
    monkeypatch.setattr(sintorn_flythrough, "FLIGHTS", {"few": FLIGHT, "gone": FLIGHT})
    monkeypatch.setattr(sintorn_flythrough, "SIZES", (16, 64))
    monkeypatch.setattr(sintorn_variants, "SCENES", {"card": BenchScene(card), "gone": BenchScene("gone.glb")})
    monkeypatch.setattr(sintorn_variants, "SIZE", (24, 24))


def card() -> um.Scene:
    """A trunk, and a leaf whose left half is cut away."""
    picture = np.full((4, 4, 4), 255, np.uint8)
    picture[:, :2, 3] = 0
    leaf = um.Material((1.0, 1.0, 1.0, 1.0), "MASK", texture=picture, name="leaf")
    build = Builder([um.Material(name="bark"), leaf])
    build.box((-0.1, 0.0, -0.1), (0.1, 2.0, 0.1), "bark")
    build.quad([(-1, 2, 1), (1, 2, 1), (1, 2.2, -1), (-1, 2.2, -1)], "leaf", [(0, 1), (1, 1), (1, 0), (0, 0)])
    return build.scene()


def test_flights_count_the_paths_operations_and_name_what_is_not_there():
    record = run_flythrough(None, ("few", "gone"), (16, 64), (), 3, Clock())
    assert record.sweep.columns == ("few 16", "few 64", "gone 16", "gone 64")
    plain, culled = (record.cell(row, "few 64") for row in ("frustum", "frustum, culled"))
    assert len(plain.seconds) == 3 and not record.broken and plain.checked > 0
    tests = plain.counters["tile_frustum_tests"] + plain.counters["sample_frustum_tests"]
    assert plain.value(OPERATIONS) == tests / 1e6 > culled.value(OPERATIONS) > 0
    assert {one.not_run is not None for one in record.cells if one.column.startswith("gone")} == {True}


@pytest.mark.usefixtures("opengl")
def test_volumes_update_sixteen_times_as_often_with_sixteen_times_the_samples():
    record = run_flythrough(None, ("few",), (64, 256), (64, 256), 1, Clock())
    assert record.rows == ("frustum", "frustum, culled", "frustum-gl", "frustum-gl, culled", "z-pass", "z-fail")
    for row in ("z-pass", "z-fail"):
        few, many = (record.cell(row, f"few {size}") for size in (64, 256))
        assert few.counters["zfail"] == (row == "z-fail")
        assert few.value(OPERATIONS) == few.counters["counter_updates"] / 1e6
        assert many.value(OPERATIONS) == pytest.approx(16 * few.value(OPERATIONS), rel=0.1)
    few, many = (record.cell("frustum-gl", f"few {size}").value(OPERATIONS) for size in (64, 256))
    assert 0 < many < 8 * few


def test_papers_ratios_are_those_of_culling():
    sweep = sintorn_flythrough.sweep_of(("sponza",), (1024, 4096))
    record, about = SweepRecord(sweep, {}, ""), ("frustum, culled", "sponza 1024", "citadel, GTX480")
    assert record.paper_ratio(*about, OPERATIONS) == 1 / 2.2 and record.paper_ratio(*about) is None


def test_leaves_change_and_the_trunk_stays():
    scene = over_ground(card())
    leaves = transmission_of(scene).kind != SOLID
    assert leaves.sum() == 2 and len(scene.triangles) == 12 + 2 + 2
    assert scene.bounds[0, 1] == 0 and (scene.triangles[-2:] >= len(scene.positions) - 4).all()
    kinds = {"binary": None, "cut out": VARYING, "half": EVEN, "textured": VARYING, "coloured": EVEN}
    for row, kind in kinds.items():
        table = transmission_of(with_leaves(LEAVES[row][0])(scene))
        assert (table is None) if kind is None else (table.kind == np.where(leaves, kind, SOLID)).all()


def test_variants_are_exact_but_for_chance():
    record = run_variants(None, ["card"], False, 2, (24, 24), Clock())
    assert record.rows == tuple(LEAVES) and record.sweep.columns == ("card, frustum",) and not record.broken
    for row in LEAVES:
        cell = record.cell(row, "card, frustum")
        assert cell.guarantee == ("none" if row == "textured, by chance" else "exact") and cell.value(TIME) > 0
    assert record.paper_ratio("textured", "card, frustum", "tree, GTX480") == pytest.approx(1.633, abs=1e-3)


def test_layers_end_where_no_more_glass_is_and_each_is_exact():
    record = sintorn_layers.run_layers(32, False, 1, (48, 48), Clock())
    assert 8 < len(record.sweep.columns) < 32 and not record.broken
    assert record.sweep.columns == tuple(str(1 + number) for number in range(len(record.sweep.columns)))
    layers = sample_layers(sintorn_layers.glass(), sintorn_layers.views(1, (48, 48))[0].camera, 32)
    for column, layer in zip(record.sweep.columns, layers, strict=True):
        cell = record.cell("frustum", column)
        assert cell.guarantee == "exact" and cell.checked == layer.covered.sum() and cell.value(TIME) > 0


@pytest.mark.usefixtures("opengl")
def test_bytes_of_every_buffer_beside_the_papers():
    record = run_memory((32, 64), Clock())
    assert record.rows == tuple(one.row for one in BUFFERS) and all(one.not_run is None for one in record.cells)
    at = {row: record.cell(row, "64x64").counters["bytes"] for row in record.rows}
    assert at["shadow volumes, stencil"] == 64 * 64 and at["shadow volumes, float counter"] == 4 * 64 * 64
    assert at["shadow map, cube"] == 4 * 64 * 64
    # 64 x 64 samples, 128 nodes of 4 x 8 of them, 4 nodes of 8 x 4 of these, a root: a word each.
    assert at["frustum-gl, shadow buffer"] == 4 * (128 + 4 + 1)
    assert at["frustum-gl, samples"] == 32 * 64 * 64
    assert at["frustum-gl, by chance"] == 4 * (128 + 4 + 1) + 12 * 128
    assert record.cell("shadow volumes, stencil", "64x64").value(PER_SAMPLE) == 8.0
    assert record.paper_value("shadow volumes, stencil", "64x64", "the paper's picture", PER_SAMPLE) == 8.0
    assert record.paper_value("shadow volumes, stencil", "64x64", "the paper's picture", MEMORY) is None


def test_commands_print_write_and_refuse(capsys, tmp_path, monkeypatch):
    assert cli.run(["bench", "sintorn-flythrough", "--scene", "gone", "-o", "f.json", "--quiet"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "gone 16 not run: model gone.glb not found" in out
    assert json.loads((tmp_path / "f.json").read_text())["benchmark"] == "sintorn-flythrough"
    assert cli.run(["bench", "sintorn-variants", "--scene", "gone", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sweep"]["size"] == [24, 24]
    monkeypatch.setattr(sintorn_memory, "SIZES", ())
    assert cli.run(["bench", "sintorn-memory", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["benchmark"] == "sintorn-memory"
    monkeypatch.setattr(sintorn_layers, "SIZE", (16, 16))
    assert cli.run(["bench", "sintorn-layers", "--layers", "2", "--frames", "1"]) == 0
    assert "Glass behind glass" in capsys.readouterr().out
    for command in ("sintorn-flythrough", "sintorn-variants"):
        assert cli.run(["bench", command, "--scene", "spoon"]) == 2
        err = capsys.readouterr().err
        assert "unknown scene 'spoon'" in err and err.count("\n") == 1
    assert cli.run(["bench", "sintorn-memory", "-o", "m.txt"]) == 2
