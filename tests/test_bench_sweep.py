"""Tables of papers made anew: every row on every frame, ratios beside the paper's, and what is wrong said aloud."""

import dataclasses

import pytest
from rich.console import Console

import umbrae as um
from umbrae import models
from umbrae.bench import sweep_run
from umbrae.bench.case import View
from umbrae.bench.sweep import TIME, Cell, PaperRow, Quantity, Sweep, SweepRecord
from umbrae.bench.sweep_run import Column, run_sweep
from umbrae.clock import Clock
from umbrae.errors import InputError, ModelError
from umbrae.methods import make_method
from umbrae.scene import Scene

SWEEP = Sweep(
    "milet-test", "Spheres", "Table 0", "triangles", ("few", "more"), "fast",
    (PaperRow("fast", "card", {"few": 2.0, "more": 4.0}), PaperRow("slow", "card", {"few": 5.0})),
)  # fmt: skip
CELLS = (
    Cell("fast", "few", "exact", (1.0, 3.0, 2.0), {"tests": 7}, 10, 0),
    Cell("slow", "few", "banded", (4.0, 6.0, 5.0), {}, 10, 0),
    Cell("slow", "more", "banded", not_run="no OpenGL"),
)


def spheres() -> Scene:
    return models.spheres(triangles=900)


def views(scene: Scene) -> list[View]:
    camera = um.Camera.frame(scene, width=24, height=16)
    return [View(camera, models.spheres_light())] * 3


def printed(record: SweepRecord, width: int = 120) -> str:
    console = Console(width=width, record=True, quiet=False, file=None)
    with console.capture() as capture:
        record.show(console)
    return capture.get()


def test_ratios_are_those_of_medians_and_of_the_papers_figures():
    record = SweepRecord.of(SWEEP, CELLS)
    assert record.ratio("slow", "few") == 2.5
    assert record.ratio("slow", "more") is None
    assert record.paper_ratio("slow", "few", "card") == 2.5
    assert record.paper_ratio("slow", "more", "card") is None
    text = printed(record)
    assert "2000.0" in text and "5000.0" in text and "slow not run: no OpenGL" in text and "WRONG" not in text


def test_broken_promises_are_named_and_those_that_promise_nothing_are_not():
    wrong = dataclasses.replace(CELLS[1], wrong=3)
    assert SweepRecord.of(SWEEP, [CELLS[0], wrong]).broken
    assert "WRONG: slow promises banded verdicts, but 3 of 10" in printed(SweepRecord.of(SWEEP, [CELLS[0], wrong]))
    assert not SweepRecord.of(SWEEP, [CELLS[0], dataclasses.replace(wrong, guarantee="none")]).broken


TESTS = Quantity("tests", "million", 1e6, ("tile_tests", "sample_tests"))
BYTES = Quantity("memory", "MiB", 2**20, ("buffer_bytes",), comparable=True)


def test_counters_that_a_method_has_are_added_up_and_compared():
    cells = [
        Cell("fast", "few", "exact", (1.0,), {"tile_tests": 1_000_000, "sample_tests": 3_000_000, "other": 9}),
        Cell("slow", "few", "exact", (1.0,), {"sample_tests": 2_000_000}),
        Cell("none", "few", "exact", (1.0,), {"other": 1}),
        Cell("slow", "more", not_run="no OpenGL"),
    ]
    paper = (PaperRow("fast", "card", {"few": 10.0}, "tests"), PaperRow("slow", "card", {"few": 25.0}, "tests"))
    record = SweepRecord.of(dataclasses.replace(SWEEP, quantities=(TIME, TESTS), paper=paper), cells)
    assert [cell.value(TESTS) for cell in cells] == [4.0, 2.0, None, None]
    assert [cell.value(TIME) for cell in cells] == [1000.0, 1000.0, 1000.0, None]
    assert (record.ratio("slow", "few", TESTS), record.ratio("slow", "few")) == (0.5, 1.0)
    assert record.ratio("none", "few", TESTS) is None
    assert (record.paper_ratio("slow", "few", "card", TESTS), record.paper_ratio("slow", "few", "card")) == (2.5, None)
    lines = [line.split() for line in printed(record).splitlines()]
    assert ["fast,", "million", "4.00"] in lines and ["slow", "/", "fast", "0.50"] in lines
    assert ["card", "2.50"] in lines and not any(line[:2] == ["none,", "million"] for line in lines)


def test_columns_that_do_not_fit_come_below():
    columns = tuple(f"some scene {number}" for number in range(7))
    cells = [
        Cell(row, column, seconds=(number + 1.0,)) for number, column in enumerate(columns) for row in ("fast", "slow")
    ]
    text = printed(SweepRecord.of(dataclasses.replace(SWEEP, columns=columns), cells), 60)
    assert all(text.count(column) == 1 for column in columns) and "…" not in text
    assert [text.count(f"{number + 1}000.0") for number in range(7)] == [2] * 7
    assert max(len(line) for line in text.splitlines()) <= 60 and text.count("triangles") == 3


def test_a_column_that_did_not_run_is_named_once():
    missing = [Cell(row, "more", not_run="no model") for row in ("fast", "slow")]
    text = printed(SweepRecord.of(SWEEP, [*missing, Cell("slow", "few", not_run="no OpenGL"), CELLS[0]]))
    assert text.count("not run") == 2 and "more not run: no model" in text and "slow not run: no OpenGL" in text


def test_what_means_the_same_everywhere_stands_beside_the_papers_values():
    cells = [Cell("stencil", "few", "", (), {"buffer_bytes": 3 << 20}), Cell("lists", "few", not_run="no memory")]
    paper = tuple(PaperRow(name, "card", {"few": 16.0}, "memory") for name in ("stencil", "lists"))
    record = SweepRecord.of(dataclasses.replace(SWEEP, base="stencil", quantities=(BYTES,), paper=paper), cells)
    lines = [line.split() for line in printed(record).splitlines()]
    assert ["stencil,", "MiB", "3.00"] in lines and lines.count(["card", "16.00"]) == 2
    assert ["lists,", "MiB"] in lines and not any("/" in line for line in lines[1:])


def test_a_record_survives_the_disk(tmp_path):
    record = SweepRecord.of(dataclasses.replace(SWEEP, size=(8, 6), quantities=(TESTS, TIME)), CELLS)
    record.save(tmp_path / "r.json")
    assert SweepRecord.load(tmp_path / "r.json") == record


@pytest.mark.parametrize("text", ["{}", "[]", "no", '{"schema": 1, "sweep": 3}', '{"schema": 2}'])
def test_what_is_no_record_is_refused_in_a_line(tmp_path, text):
    (tmp_path / "r.json").write_text(text)
    with pytest.raises(InputError) as refused:
        SweepRecord.load(tmp_path / "r.json")
    assert "r.json" in str(refused.value) and "\n" not in str(refused.value)


def test_all_rows_see_all_frames_and_are_held_against_the_oracle():
    def missing() -> Scene:
        raise ModelError("model sponza not found")

    rows = {"fast": make_method("frustum"), "lists": make_method("alias-free-map")}
    columns = [Column("few", spheres, views, rows), Column("more", missing, views, rows)]
    record = run_sweep(SWEEP, columns, 50, Clock())
    assert [(one.row, one.column) for one in record.cells] == [
        ("fast", "few"), ("lists", "few"), ("fast", "more"), ("lists", "more"),
    ]  # fmt: skip
    for cell in record.cells[:2]:
        assert len(cell.seconds) == 3 and cell.checked == 50 and cell.wrong == 0 and cell.guarantee == "exact"
    assert record.cells[0].counters["sample_frustum_tests"] > 0
    assert {cell.not_run for cell in record.cells[2:]} == {"model sponza not found"}


def test_rows_may_give_the_scene_other_materials_and_take_back_a_promise():
    def glass(scene: Scene) -> Scene:
        return Scene(scene.positions, scene.triangles, [um.Material((1.0, 1.0, 1.0, 0.5), "BLEND")])

    rows = {"solid": make_method("frustum"), "glass": make_method("frustum")}
    rows["chance"] = make_method("frustum", transparency="stochastic")
    column = Column("few", spheres, views, rows, {"glass": glass, "chance": glass})
    solid, exact, chance = run_sweep(SWEEP, [column], 200, Clock()).cells
    assert (solid.guarantee, solid.wrong, exact.guarantee, exact.wrong) == ("exact", 0, "exact", 0)
    assert exact.counters["shadow_buffer_bytes"] > solid.counters["shadow_buffer_bytes"]
    assert chance.guarantee == "none" and chance.wrong > 0 and not chance.broken


def test_a_picture_takes_its_samples_and_shading_too(monkeypatch):
    monkeypatch.setattr(sweep_run, "stopwatch", lambda work: (1.0, work()))
    columns = [Column(str(whole), spheres, views, {"fast": make_method("frustum")}, picture=whole) for whole in (0, 1)]
    assert [cell.seconds for cell in run_sweep(SWEEP, columns, 50, Clock()).cells] == [(1.0,) * 3, (3.0,) * 3]


@pytest.mark.usefixtures("opengl")
def test_what_opengl_had_of_the_time_is_counted():
    rows = {"cpu": make_method("frustum"), "gl": make_method("silhouette-gs")}
    cpu, gl = run_sweep(SWEEP, [Column("few", spheres, views, rows)], 50, Clock()).cells
    assert "opengl_ns" not in cpu.counters
    assert 0 < gl.counters["opengl_ns"] < 1e9 * max(gl.seconds)


def test_columns_that_do_not_fit_side_by_side_go_on_below():
    names = tuple(f"column {number}" for number in range(12))
    cells = [Cell(row, name, "exact", (1.0 + n,)) for row in ("fast", "slow") for n, name in enumerate(names)]
    lines = printed(SweepRecord.of(dataclasses.replace(SWEEP, columns=names), cells), 60).splitlines()
    assert max(map(len, lines)) <= 60
    assert [word for line in lines if line.startswith("fast, ms") for word in line.split()[2:]] == [
        f"{1000 + 1000 * n}.0" for n in range(12)
    ]
    assert sum(line.startswith("triangles") for line in lines) > 1 and not any("…" in line for line in lines)


@pytest.mark.usefixtures("opengl")
def test_methods_that_promise_nothing_count_what_is_wrong():
    rows = {"coarse": make_method("shadow-map", size=16)}
    record = run_sweep(SWEEP, [Column("few", spheres, views, rows)], 200, Clock())
    (cell,) = record.cells
    assert cell.wrong > 0 and not cell.broken
