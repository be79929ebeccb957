"""`umbrae sun`, end to end."""

import json

import numpy as np
import pytest
from PIL import Image

import umbrae as um
from umbrae import cli

PLACE = ["--lat", "48.3", "--lon", "14.3"]
DAY = ["--date", "2026-06-21", "--step", "2h"]
SMALL = ["--size", "64x80"]


@pytest.fixture
def model(tmp_path, monkeypatch):
    """A roof over a floor, in the current folder."""
    monkeypatch.chdir(tmp_path)
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    scene = um.Scene(
        np.concatenate([4 * corners, corners + np.array([0, 2, 0])]), [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    )
    um.save(scene, "roof.glb")
    return tmp_path


def sun(*options):
    return cli.run(["sun", "roof.glb", *map(str, options)])


def test_a_picture_by_default(model, capsys):
    assert sun(*PLACE, *DAY, *SMALL) == 0
    out, err = capsys.readouterr()
    assert out == "roof_sun.png\n"
    assert "2026-06-21, times in UTC+01:00: the sun is above the horizon for 16.0 hours" in err
    with Image.open("roof_sun.png") as picture:
        assert picture.size == (64, 80) and len(np.unique(np.asarray(picture))) > 20


def test_every_kind_of_file_at_once(model, capsys):
    names = ["a.png", "a.npz", "a.csv", "a.ply", "a.glb"]
    outputs = [text for name in names for text in ("-o", name)]
    assert sun(*PLACE, *DAY, *SMALL, "--grid", 0.5, "--timezone", "Europe/Vienna", "--json", *outputs) == 0
    out, err = capsys.readouterr()
    facts = json.loads(out)
    assert err == "" and facts["outputs"] == names and all((model / name).exists() for name in names)
    assert (facts["timezone"], facts["positions"], facts["step_minutes"]) == ("Europe/Vienna", 12, 120)
    assert facts["sensors"] == 16 * 16 + 4 * 4 and facts["guarantee"] == "exact"
    with np.load("a.npz") as arrays:
        hours = arrays["hours"]
        assert np.average(hours, weights=arrays["area"]) == pytest.approx(facts["mean_hours"])
        assert (hours[arrays["position"][:, 1] > 1] == facts["possible_hours"]).all(), "nothing shades the roof"
        below = (np.abs(arrays["position"]) < 0.6).all(axis=1)
        assert hours[below].min() < facts["possible_hours"]


def test_sides(model, capsys):
    hours = {}
    for side in ("front", "back", "sunnier"):
        assert sun(*PLACE, *DAY, "-o", "a.npz", "--side", side, "--quiet") == 0
        with np.load("a.npz") as arrays:
            hours[side], normal = arrays["hours"], arrays["normal"]
    assert (hours["back"] == 0).all() and (hours["front"] > 0).all() and (normal[:, 1] == 1).all()
    assert (hours["sunnier"] == hours["front"]).all()


def test_polar_night_is_a_result(model, capsys):
    assert (
        sun("--lat", 78.2, "--lon", 15.6, "--date", "2026-12-21", "--step", "2h", *SMALL, "-o", "a.npz", "-o", "a.png")
        == 0
    )
    assert "the sun does not rise on that day: 0 hours everywhere" in capsys.readouterr().err
    with np.load("a.npz") as arrays:
        assert (arrays["hours"] == 0).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([*PLACE, "--date", "2026-02-30"], "date: wanted a date YYYY-MM-DD that exists, got '2026-02-30'"),
        ([*PLACE, "--date", "midsummer"], "date: wanted a date YYYY-MM-DD that exists, got 'midsummer'"),
        ([*PLACE], "Missing option '--date'"),
        (["--lat", "91", "--lon", "14.3", *DAY], "latitude: wanted -90 to 90 degrees north, got 91.0"),
        (["--lat", "nan", "--lon", "14.3", *DAY], "latitude: wanted a finite number, got nan"),
        (["--lat", "48,3", "--lon", "14.3", *DAY], "Invalid value for '--lat'"),
        (["--lat", "48.3", "--lon", "200", *DAY], "longitude: wanted -180 to 180 degrees east, got 200.0"),
        ([*PLACE, *DAY, "--timezone", "Europe/Wien"], "timezone: wanted a name such as Europe/Vienna or UTC"),
        ([*PLACE, *DAY, "--step", "10 parsecs"], "wanted a time > 0 such as 10min, 30s or 1h, got '10 parsecs'"),
        ([*PLACE, *DAY, "--step", "0min"], "wanted a time > 0 such as 10min, 30s or 1h, got '0min'"),
        ([*PLACE, *DAY, "--step", "-5min"], "wanted a time > 0 such as 10min, 30s or 1h, got '-5min'"),
        ([*PLACE, *DAY, "--step", "0.1s"], "step: wanted one second up to the day's"),
        ([*PLACE, *DAY, "--step", "25h"], "step: wanted one second up to the day's 1 day, 0:00:00, got 1 day, 1:00:00"),
        ([*PLACE, *DAY, "--north", "inf"], "north: wanted a finite number, got inf"),
        ([*PLACE, *DAY, "--up", "1,1,0"], "up: wanted y or z"),
        ([*PLACE, *DAY, "--grid", "0", "-o", "a.csv"], "spacing: wanted a distance > 0, got 0.0"),
        ([*PLACE, *DAY, "--grid", "nan", "-o", "a.csv"], "spacing: wanted a finite number, got nan"),
        ([*PLACE, *DAY, "--grid", "1e-6", "-o", "a.csv"], "would fit) needs"),
        ([*PLACE, *DAY, "--grid", "1"], "--grid is for sensors: wanted an output of .npz .csv .glb .ply"),
        ([*PLACE, *DAY, "--side", "top"], "'top' is not one of"),
        ([*PLACE, *DAY, "-o", "a.txt"], "a.txt: unknown extension '.txt'"),
        ([*PLACE, *DAY, "-o", "roof.glb"], "roof.glb: would overwrite the model"),
        ([*PLACE, *DAY, "-o", "a.csv", "-o", "a.csv"], "a.csv: would overwrite another output"),
        ([*PLACE, *DAY, "-o", "no/a.csv"], "no such folder"),
        ([*PLACE, *DAY, "--size", "64x40"], "wanted more than 40 pixels of height, which the legend takes"),
        ([*PLACE, *DAY, *SMALL, "--samples-per-pixel", "3"], "wanted a square number such as 1, 4 or 9, got 3"),
        ([*PLACE, *DAY, "--method", "magic"], "unknown method 'magic'"),
        ([*PLACE, *DAY, "--method", "silhouette-cpu", "-o", "a.csv"], "takes pictures only, and sensors are points"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_clear_line(model, capsys, options, message):
    assert sun(*options, "--quiet") == 2
    out, err = capsys.readouterr()
    assert message in err and err.startswith("umbrae: error: ") and err.count("\n") == 1 and out == ""
    assert [path.name for path in model.iterdir()] == ["roof.glb"], "nothing is left behind"


def test_models_without_triangles(model, capsys):
    (model / "roof.glb").write_bytes(b"")
    assert sun(*PLACE, *DAY) == 2
    assert "is empty" in capsys.readouterr().err


def test_without_the_extra(model, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "cmap", None)
    assert sun(*PLACE, *DAY, *SMALL) == 2
    assert "pip install 'umbrae[sun]'" in capsys.readouterr().err


def test_interruptions_leave_nothing(model, capsys, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("umbrae.methods.frustum_cpu.FrustumCaster.shadow", stop)
    assert sun(*PLACE, *DAY, "-o", "a.csv") == 130
    assert [path.name for path in model.iterdir()] == ["roof.glb"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--samples-per-pixel", 3], "wanted a square number"),
        (["--fov", 500], "between 0 and 180"),
        (["--eye", "0,0,0", "--target", "0,0,0"], "eye"),
    ],
)
def test_what_the_picture_refuses_ends_before_any_work(model, capsys, options, message):
    assert sun(*PLACE, *DAY, *SMALL, "-o", "a.csv", "-o", "a.png", *options) == 2
    out, err = capsys.readouterr()
    assert message in err and out == "" and not (model / "a.csv").exists()


def test_one_step_may_be_the_whole_day(model, capsys):
    assert sun(*PLACE, "--date", "2026-06-21", "--step", "24h", "--json", "-o", "a.csv") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["positions"], facts["possible_hours"]) == (1, 24)
