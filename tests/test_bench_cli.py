"""`umbrae bench` as a user meets it, with runners that need no extra."""

import json

import pytest

import umbrae as um
from test_bench import AllLit, Right, roof
from umbrae import cli
from umbrae.bench import commands
from umbrae.bench.record import Record
from umbrae.bench.scenes import SCENES, BenchScene
from umbrae.mask import Guarantee


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A fresh current folder, a tiny scene, one runner and one comparator that is not installed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("UMBRAE_MODELS", raising=False)
    monkeypatch.setitem(SCENES, "tiny", BenchScene(roof))
    monkeypatch.setitem(SCENES, "model", BenchScene("here.glb"))
    monkeypatch.setattr(commands, "compile_kernels", lambda *_: None)
    monkeypatch.setattr(commands, "exact_methods", lambda: [Right()])
    monkeypatch.setattr(commands, "MitsubaRunner", lambda: AllLit("mitsuba", Guarantee.NONE))
    monkeypatch.setattr(commands, "EmbreexRunner", lambda: Right("embreex", missing="embreex is not installed"))
    monkeypatch.setattr(commands, "WarpRunner", lambda: Right("warp", missing="warp finds no device cuda:0"))
    return tmp_path


def rays(texts, *more):
    return cli.run(["bench", "rays", "--runs", "1", "--resolution", "32x18", "--check", "50", *texts.split(), *more])


def test_a_table_on_stdout_and_a_file_on_disk(capsys, folder):
    assert rays("--scene tiny -o a.json") == 0
    out, err = capsys.readouterr()
    assert "tiny, point light, 32x18" in out and "tiny, directional light, 32x18" in out
    assert "embreex not run: embreex is not installed" in out
    assert max(len(line) for line in out.splitlines()) <= 80
    assert "tiny point 32x18" in err and "\x1b" not in out + err
    cases = Record.load(folder / "a.json").cases
    assert [str(result.case) for result in cases] == ["tiny point 32x18", "tiny directional 32x18"]


def test_json_is_all_there_is_on_stdout(capsys):
    assert rays("--scene tiny --light point --json") == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert err == "" and document["schema"] == 1 and document["configuration"]["runs"] == 1
    assert [runner["name"] for runner in document["cases"][0]["runners"]] == ["right", "mitsuba", "embreex", "warp"]


def test_a_broken_guarantee_is_exit_status_1(capsys, monkeypatch):
    monkeypatch.setattr(commands, "exact_methods", lambda: [AllLit("liar", Guarantee.EXACT)])
    assert rays("--scene tiny --light point") == 1
    assert "WRONG: liar promises exact" in capsys.readouterr().out


def test_models_come_from_the_option_or_the_environment(capsys, folder, monkeypatch):
    um.save(roof(), folder / "here.glb")
    assert rays("--scene model --light point --models .") == 0
    assert "2 triangles" in capsys.readouterr().out
    monkeypatch.setenv("UMBRAE_MODELS", str(folder))
    assert rays("--scene model --light point") == 0
    assert "2 triangles" in capsys.readouterr().out
    (folder / "here.glb").unlink()
    assert rays("--scene model --light point") == 0
    assert f"not run: model here.glb not found in {folder}" in " ".join(capsys.readouterr().out.split())


def test_resuming_a_finished_file_measures_nothing(capsys, folder, monkeypatch):
    assert rays("--scene tiny --light point -o a.json") == 0
    before = (folder / "a.json").read_text()
    monkeypatch.setattr(Right, "shadow", None)
    assert rays("--scene tiny --light point --resume a.json") == 0
    assert (folder / "a.json").read_text() == before
    assert "tiny, point light" in capsys.readouterr().out


def test_a_flight_has_a_frame_for_each_run(capsys, folder):
    lines = ["time,x,y,z,view_x,view_y,view_z,up_x,up_y,up_z", "0,0,5,9,0,-5,-9,0,1,0", "1,4,5,7,-4,-5,-7,0,1,0"]
    (folder / "a.csv").write_text("\n".join(lines))
    assert rays("--scene tiny --light point --path a.csv --runs 3 -o a.json") == 0
    record = Record.load(folder / "a.json")
    assert len(record.cases[0].runners[0].seconds["warm"].runs) == 3
    assert record.configuration["path"]["name"] == "a.csv"


def test_check_prints_one_line(capsys, monkeypatch):
    monkeypatch.setattr(commands, "CHECK_SCENE", "tiny")
    monkeypatch.setattr(commands, "CHECK_SIZE", (32, 18))
    assert cli.run(["bench", "check"]) == 0
    out, _ = capsys.readouterr()
    assert out.startswith("right beside Embree on tiny point 32x18: ") and out.endswith(" x warm\n")
    monkeypatch.setattr(commands, "MitsubaRunner", lambda: Right(missing="mitsuba is not installed: ..."))
    assert cli.run(["bench", "check"]) == 0
    assert capsys.readouterr().out == "not compared with Embree: mitsuba is not installed: ...\n"


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ("--scene nowhere", "unknown scene 'nowhere' (known: pavilion, spheres-96k,"),
        ("--light moon", "--light: wanted point, directional or both, got 'moon'"),
        ("--resolution 32", "wanted two whole numbers such as 1920x1080, got '32'"),
        ("--resolution 32x18,", "wanted two whole numbers such as 1920x1080, got ''"),
        ("--resolution 0x18", "wanted two whole numbers of at least 1"),
        ("--resolution 32x18,99999x18", "--resolution: wanted 1 to 65536 pixels a side, got 99999x18"),
        ("--runs 0", "'--runs': Input should be greater"),
        ("--check 0", "'--check': Input should be greater"),
        ("--models nowhere", "--models: nowhere is not a folder"),
        ("-o a.txt", "unknown extension '.txt', wanted one of .json"),
        ("-o no/a.json", "no such folder"),
        ("--resume no.json", "no.json: cannot be read: No such file"),
        ("--resume a.json -o b.json", "--resume goes on writing its own file"),
        ("--path no.csv --scene tiny", "no.csv: cannot be read"),
    ],
)
def test_bad_options_end_in_one_line(capsys, texts, message):
    assert rays(texts) == 2
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if line.startswith("umbrae: error: ")]
    assert out == "" and len(lines) == 1 and message in lines[0] and err.splitlines()[-1] == lines[0]


def test_a_flight_wants_one_scene(capsys, folder):
    (folder / "a.csv").write_text(
        "time,x,y,z,view_x,view_y,view_z,up_x,up_y,up_z\n0,0,0,0,1,0,0,0,1,0\n1,1,0,0,1,0,0,0,1,0\n"
    )
    assert rays("--path a.csv") == 2
    assert "--path belongs to one scene" in capsys.readouterr().err
