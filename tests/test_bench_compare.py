"""`umbrae bench compare`: what became slower, told apart from what runs differ among themselves."""

import json
from pathlib import Path

import pytest

from umbrae import cli
from umbrae.bench.compare import compare
from umbrae.bench.results import load_result
from umbrae.bench.sweep import Cell, Sweep, SweepRecord
from umbrae.errors import InputError

RESULTS = Path(__file__).parents[1] / "results"
SWEEP = Sweep("milet-test", "Spheres", "Table 0", "triangles", ("few", "more"), "fast")
FLIGHT = [0.010, 0.030, 0.090, 0.270, 0.810]


def saved(path, cells, sweep=SWEEP):
    SweepRecord.of(sweep, [Cell(*name, "exact", tuple(seconds)) for name, seconds in cells.items()]).save(path)
    return path


def changed(path, name, change):
    """A copy of one of the project's own results, with something else in it."""
    document = json.loads((RESULTS / name).read_text())
    change(document)
    path.write_text(json.dumps(document))
    return path


def of_flights(folder, old, new):
    files = [saved(folder / name, {("fast", "few"): seconds}) for name, seconds in (("a.json", old), ("b.json", new))]
    return compare(*map(load_result, files))


WITHOUT_TIMES = ("pyvista", "sintorn-memory")


@pytest.mark.parametrize("name", sorted(path.name for path in RESULTS.glob("*.json")))
def test_a_result_beside_itself_has_no_change(name, capsys):
    if Path(name).stem in WITHOUT_TIMES:
        assert cli.run(["bench", "compare", str(RESULTS / name), str(RESULTS / name)]) == 2
        assert capsys.readouterr().err.endswith(f"{name}: {Path(name).stem} has no times to compare\n")
        return
    assert cli.run(["bench", "compare", str(RESULTS / name), str(RESULTS / name)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("0 slower, 0 faster, of ") and not out.startswith("0 slower, 0 faster, of 0") and err == ""


def test_frames_are_held_against_their_counterparts(tmp_path):
    """Half as long again in each frame: far less than frames differ among themselves, and still no chance."""
    (one,) = of_flights(tmp_path, FLIGHT, [1.5 * seconds for seconds in FLIGHT]).slower
    assert one.name == "few: fast" and one.ratio == pytest.approx(1.5) and (one.old, one.new) == (0.09, 0.135)
    found = of_flights(tmp_path, FLIGHT, [0.5 * seconds for seconds in FLIGHT])
    assert not found.slower and [one.ratio for one in found.faster] == [0.5]


def test_a_change_that_not_all_frames_show_is_none(tmp_path):
    worse = [1.5 * seconds for seconds in FLIGHT[:4]] + [0.9 * FLIGHT[4]]
    assert not of_flights(tmp_path, FLIGHT, worse).slower


def test_small_changes_are_none(tmp_path):
    assert not of_flights(tmp_path, FLIGHT, [1.04 * seconds for seconds in FLIGHT]).slower
    assert of_flights(tmp_path, FLIGHT, [1.06 * seconds for seconds in FLIGHT]).slower


def test_two_runs_have_no_spread(tmp_path):
    found = of_flights(tmp_path, FLIGHT[:2], [9 * seconds for seconds in FLIGHT[:2]])
    assert not found.changes and found.few == ("few: fast",)


def test_what_is_not_measured_any_more_is_named(tmp_path, capsys):
    old = saved(tmp_path / "a.json", {("fast", "few"): FLIGHT, ("slow", "few"): FLIGHT})
    new = saved(tmp_path / "b.json", {("fast", "few"): FLIGHT})
    assert cli.run(["bench", "compare", str(old), str(new)]) == 0
    assert "few: slow: not measured any more" in capsys.readouterr().out


@pytest.mark.parametrize(("factor", "slower"), [(1.3, 1), (1 / 1.3, 0)])
def test_repetitions_are_held_against_their_spread(tmp_path, capsys, factor, slower):
    """The cold runs of one runner take longer, in no order that the old ones had."""

    def change(document):
        times = document["cases"][0]["runners"][0]["seconds"]["cold"]
        times["runs"] = [factor * seconds for seconds in reversed(times["runs"])]

    new = changed(tmp_path / "new.json", "rays.json", change)
    assert cli.run(["bench", "compare", str(RESULTS / "rays.json"), str(new)]) == slower
    out = capsys.readouterr().out
    assert f"{slower} slower, {1 - slower} faster, of {len(load_result(new).times())};" in out
    assert "spheres-96k, point, 1920x1080" in out and f"{factor:.2f}" in out


def test_runs_whose_middle_halves_overlap_are_the_same(tmp_path):
    def spread(seconds):
        def change(document):
            document["cases"][0]["runners"][0]["seconds"]["cold"]["runs"] = seconds

        return change

    old = changed(tmp_path / "a.json", "rays.json", spread([1.0, 2.0, 3.0, 4.0, 5.0]))
    for runs, count in (([3.9, 3.9, 4.5, 4.6, 4.6], 0), ([4.1, 4.1, 4.5, 4.6, 4.6], 1)):
        new = changed(tmp_path / "b.json", "rays.json", spread(runs))
        assert len(compare(load_result(old), load_result(new)).slower) == count


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("sun.json", lambda document: document.update(scene="sponza")),
        ("stich-city-frustum.json", lambda document: document.update(lots=[2, 2])),
        ("mattausch.json", lambda document: [run.update(model="teapot") for run in document["runs"]]),
    ],
)
def test_other_scenes_are_not_compared(tmp_path, name, change):
    other = load_result(changed(tmp_path / "a.json", name, change))
    with pytest.raises(InputError, match="no measurement in common"):
        compare(load_result(RESULTS / name), other)


def test_other_benchmarks_are_refused_in_a_line(capsys):
    assert cli.run(["bench", "compare", str(RESULTS / "sun.json"), str(RESULTS / "rays.json")]) == 2
    err = capsys.readouterr().err
    assert "wanted the same benchmark" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "warned"),
    [
        ({"cpu": "another"}, True),
        ({"threads": 1}, True),
        ({"opengl": "NVIDIA"}, True),
        ({"opengl": None}, False),
        ({"commit": "another"}, False),
    ],
)
def test_other_machines_are_warned_of(tmp_path, capsys, change, warned):
    old = changed(tmp_path / "a.json", "sun.json", lambda document: document["machine"].update(opengl="llvmpipe"))
    new = changed(
        tmp_path / "b.json", "sun.json", lambda document: document["machine"].update({"opengl": "llvmpipe", **change})
    )
    assert cli.run(["bench", "compare", str(old), str(new)]) == 0
    assert ("different machines" in capsys.readouterr().err) == warned


@pytest.mark.parametrize(
    "text",
    [
        "", "no", "[]", "{}", "3", '{"schema": 2}', '{"schema": 1}', '{"schema": 1, "benchmark": "else"}',
        '{"schema": 1, "benchmark": "sun", "machine": {}, "date": ""}',
        '{"schema": 1, "benchmark": "sun", "machine": {"cpu": "", "cores": 1, "threads": 1}, "date": ""}',
        '{"schema": 1, "benchmark": "sun", "scene": "", "sensors": 1, "suns": 1, "date": "", "machine": {"cpu": "", '
        '"cores": 1, "threads": 1}, "runs": [{"name": "a", "trace_seconds": [0]}]}',
        '{"schema": 1, "benchmark": "x", "sweep": {}, "machine": {"cpu": "", "cores": 1, "threads": 1}, "date": ""}',
    ],
)  # fmt: skip
@pytest.mark.parametrize("command", ["compare", "report"])
def test_what_is_no_result_is_refused_in_a_line(tmp_path, capsys, text, command):
    path = tmp_path / "bad.json"
    path.write_text(text)
    more = [str(path)] if command == "compare" else ["--no-pictures", "-o", str(tmp_path / "page.html")]
    assert cli.run(["bench", command, str(path), *more]) == 2
    out, err = capsys.readouterr()
    assert "bad.json" in err and err.count("\n") == 1 and out == "" and not (tmp_path / "page.html").exists()


def test_a_page_takes_no_note_that_is_no_text(tmp_path, capsys):
    path = changed(tmp_path / "bad.json", "milet-overall.json", lambda document: document["sweep"].update(note=7))
    assert cli.run(["bench", "report", str(path), "--no-pictures", "-o", str(tmp_path / "page.html")]) == 2
    assert "bad.json: damaged" in capsys.readouterr().err and not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(("factor", "told"), [(1.2, True), (1.03, False)])
def test_a_machine_that_was_busy_is_suspected(tmp_path, capsys, factor, told):
    """All of it slower, contestants of others too: hardly the work of one's own change."""
    names = [("fast", "few"), ("slow", "few"), ("mitsuba", "few")]
    old = saved(tmp_path / "a.json", dict.fromkeys(names, FLIGHT))
    new = saved(tmp_path / "b.json", {name: [factor * seconds for seconds in FLIGHT] for name in names})
    assert cli.run(["bench", "compare", str(old), str(new)]) == int(told)
    assert (f"half of all ratios are above {factor:.2f}" in capsys.readouterr().out) == told
