"""`umbrae bench sun`: sensors under the sky's patches, with contestants that behave and contestants that do not."""

import json
from pathlib import Path

import numpy as np
import pytest

import umbrae as um
from umbrae import cli, models
from umbrae.bench import commands
from umbrae.bench.embree import EmbreexRunner, MitsubaRunner
from umbrae.bench.runner import MethodRunner
from umbrae.bench.scenes import SCENES, BenchScene
from umbrae.bench.sun import pick_sensors, run_sun
from umbrae.bench.tregenza import PATCHES, patches
from umbrae.mask import Guarantee, ShadowMask

CITY = Path(__file__).parents[2] / "shared" / "scenes" / "city" / "linz-center-2km.glb"


def square():
    """A floor of four by four units, and a roof of two by two above its middle; both look up."""
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    return um.Scene(
        np.concatenate([2 * corners, corners + np.array([0, 1, 0])]), [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    )


class Frustum(MethodRunner):
    """The frustum method; what it promises can be chosen, and it keeps how many it was asked about."""

    def __init__(self, name="frustum", guarantee=Guarantee.EXACT, missing=None):
        super().__init__(um.METHODS["frustum"]())
        self.name, self.guarantee, self._missing = name, guarantee, missing
        self.asked = []

    def unavailable(self):
        return self._missing

    def set_samples(self, samples):
        self.asked.append(samples.size)
        super().set_samples(samples)


class AllLit(Frustum):
    """Says that nothing is in shadow."""

    def mask(self, answer):
        return ShadowMask(np.zeros_like(answer.in_shadow), self.guarantee)


class Interrupted(Frustum):
    """Somebody presses Ctrl-C while it works on more than the warm-up."""

    def shadow(self, light, clock):
        if len(self.asked) > 2:
            raise KeyboardInterrupt
        return super().shadow(light, clock)


def rays(kind=Frustum, name="rays"):
    return kind(name, Guarantee.NONE)


def test_the_patches_are_tregenzas():
    towards = np.array([light.position for light in patches()])
    assert towards.shape == (145, 4) and (towards[:, 3] == 0).all()
    elevation = np.degrees(np.arcsin(towards[:, 1].astype(float)))
    rows, counts = np.unique(np.round(elevation), return_counts=True)
    assert rows.tolist() == [6, 18, 30, 42, 54, 66, 78, 90] and counts.tolist() == [30, 30, 24, 24, 18, 12, 6, 1]
    # From north to the east, up to the zenith, which is exactly above.
    assert towards[0, 0] == 0 and towards[0, 2] < 0 and towards[1, 0] > 0 and towards[-1].tolist() == [0, 1, 0, 0]
    # Patches of nearly the same size: nobody's neighbour is nearer or farther than that of others.
    cosine = towards[:, :3].astype(float) @ towards[:, :3].T.astype(float) - 2 * np.eye(145)
    nearest = np.degrees(np.arccos(cosine.max(axis=1)))
    assert 10 < nearest.min() < nearest.max() < 12.5


@pytest.mark.parametrize("count", [1, 5, 144])
def test_fewer_suns_are_some_of_the_patches(count):
    every = {tuple(light.position.tolist()) for light in patches()}
    some = {tuple(light.position.tolist()) for light in patches(count)}
    assert len(some) == count and some < every


def test_sensors_are_spread_evenly_and_always_the_same():
    scene = square()
    sensors = pick_sensors(scene, 1000)
    assert sensors.shape == (1000,) and (sensors.side == 1).all()
    # Floor 16, roof 4, in square units; and as many in each quarter.
    on_floor = sensors.position[:, 1] == 0
    assert on_floor.sum() == pytest.approx(800, abs=40)
    quarter = (sensors.position[on_floor, 0] > 0) + 2 * (sensors.position[on_floor, 2] > 0)
    assert np.bincount(quarter) == pytest.approx([200] * 4, abs=30)
    assert (pick_sensors(scene, 1000).position == sensors.position).all()


def test_verdicts_that_differ_are_counted_and_rays_go_only_where_the_sun_shines():
    scene = square()
    sensors, zenith = pick_sensors(scene, 500), patches()[-1:]
    under = (np.abs(sensors.position[:, [0, 2]]) < 1).all(axis=1) & (sensors.position[:, 1] == 0)
    below = sensors.take(np.arange(50))
    turned = um.ViewSamples.on_surface(scene, below.triangle, below.barycentric, -1)
    mixed = um.ViewSamples(
        *(
            np.concatenate([getattr(sensors, name), getattr(turned, name)])
            for name in ("triangle", "barycentric", "side", "position", "covered")
        )
    )
    plain, blind, away = rays(), rays(AllLit, "blind"), Frustum("absent", missing="not here")
    runs = run_sun(scene, mixed, zenith, [Frustum(), plain, blind, away], 100, um.Clock())
    assert [(run.name, run.asked, run.differ) for run in runs] == [
        ("frustum", 550, 0),
        ("rays", 500, 0),
        ("blind", 500, under.sum()),
        ("absent", 0, 0),
    ]
    assert under.sum() > 50 and plain.asked == [500] and runs[3].not_run == "not here"
    assert [(run.checked, run.wrong) for run in runs] == [(100, 0), (0, 0), (0, 0), (0, 0)]
    for run in runs[:3]:
        assert run.prepare_seconds > 0 and len(run.trace_seconds) == 1 and run.trace_seconds[0] > 0
    assert "traversal" in runs[0].stages and runs[3].trace_seconds == ()


def test_a_broken_guarantee_has_no_times():
    scene = square()
    runs = run_sun(scene, pick_sensors(scene, 200), patches(5), [AllLit("liar"), Frustum()], 1000, um.Clock())
    for run in runs:  # the second differs from the first, which the bench believes as long as it is right
        assert run.broken and run.trace_seconds == () and run.prepare_seconds is None
    assert runs[0].checked == 1000 and runs[0].wrong == runs[1].differ > 0 == runs[1].wrong


def test_the_oracle_agrees_on_the_pavilion():
    scene = models.pavilion()
    oracle = MethodRunner(um.METHODS["oracle"]())
    runs = run_sun(scene, pick_sensors(scene, 200), patches(5), [Frustum(), oracle], 50, um.Clock())
    assert [(run.asked, run.differ, run.wrong) for run in runs] == [(1000, 0, 0), (1000, 0, 0)]


@pytest.mark.parametrize("kind", [EmbreexRunner, MitsubaRunner])
def test_embree_agrees_but_for_its_offset(kind):
    runner = kind()
    if runner.unavailable():
        pytest.skip(runner.unavailable())
    if not CITY.exists():
        pytest.skip("the city is not here")
    scene = um.load(CITY)
    runs = run_sun(scene, pick_sensors(scene, 5000), patches(8), [Frustum(), runner], 1000, um.Clock())
    assert runs[0].wrong == 0 and 0 <= runs[1].differ <= 2e-3 * runs[1].asked and runs[1].asked > 10_000


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A fresh current folder, a tiny scene, a method, a comparator that runs and one that does not."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("UMBRAE_MODELS", raising=False)
    monkeypatch.setitem(SCENES, "tiny", BenchScene(square))
    monkeypatch.setattr(commands, "compile_kernels", lambda *_: None)
    monkeypatch.setattr(commands, "exact_methods", lambda: [Frustum()])
    monkeypatch.setattr(commands, "MitsubaRunner", lambda: rays(AllLit, "mitsuba"))
    monkeypatch.setattr(commands, "EmbreexRunner", lambda: Frustum("embreex", missing="embreex is not installed"))
    return tmp_path


def bench(texts):
    return cli.run(["bench", "sun", *texts.split()])


def test_a_table_on_stdout_and_a_file_on_disk(capsys, folder):
    assert bench("--scene tiny --sensors 200 --suns 5 -o a.json") == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0] == "tiny: 4 triangles, 200 sensors, 5 suns, 1,000 verdicts"
    assert lines[1].split() == ["prepare", "s", "trace", "s", "verdicts/s", "differ"]
    assert lines[2].split()[0] == "frustum" and lines[2].split()[-1] == "0"
    assert lines[4] == "  embreex not run: embreex is not installed"
    assert "only about sensors that face the sun (100% of the verdicts)" in " ".join(out.split())
    assert max(len(line) for line in lines) <= 80 and "suns" in err and "\x1b" not in out + err
    document = json.loads((folder / "a.json").read_text())
    assert (document["schema"], document["benchmark"], document["suns"]) == (1, "sun", 5)
    assert {"cpu", "threads", "versions", "commit"} < set(document["machine"])
    blind = document["runs"][1]
    assert lines[3].split()[0] == "mitsuba" and lines[3].split()[-1] == f"{blind['differ'] / 1000:.4%}"
    assert blind["differ"] > 0 and len(blind["trace_seconds"]) == 5


def test_json_is_all_there_is_on_stdout(capsys, folder):
    assert bench("--scene tiny --sensors 50 --suns 2 --json") == 0
    out, err = capsys.readouterr()
    assert err == "" and [run["name"] for run in json.loads(out)["runs"]] == ["frustum", "mitsuba", "embreex", "warp"]
    assert not list(folder.iterdir())


def test_quiet_leaves_the_table(capsys, folder):
    assert bench("--scene tiny --sensors 50 --suns 2 -q") == 0
    out, err = capsys.readouterr()
    assert err == "" and out.startswith("tiny: ")


def test_a_wrong_verdict_is_exit_status_1(capsys, folder, monkeypatch):
    monkeypatch.setattr(commands, "exact_methods", lambda: [AllLit("liar")])
    assert bench("--scene tiny --sensors 200 --suns 5") == 1
    assert "WRONG: liar promises exact verdicts, but" in " ".join(capsys.readouterr().out.split())


def test_an_interruption_leaves_nothing_behind(capsys, folder, monkeypatch):
    monkeypatch.setattr(commands, "MitsubaRunner", lambda: rays(Interrupted, "mitsuba"))
    assert bench("--scene tiny --sensors 200 --suns 5 -o a.json") == 130
    out, err = capsys.readouterr()
    assert out == "" and err.splitlines()[-1] == "umbrae: error: interrupted" and not list(folder.iterdir())


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ("--scene nowhere", "unknown scene 'nowhere' (known: pavilion, spheres-96k,"),
        ("--scene city --models .", "model city/linz-center-2km.glb not found in ."),
        ("--sensors 0", "'--sensors': Input should be greater"),
        ("--sensors 9999999999999", "a pick of 9,999,999,999,999 sensors needs"),
        ("--suns 0", "'--suns': Input should be greater"),
        (f"--suns {PATCHES + 1}", "'--suns': Input should be less than or equal to 145"),
        ("--models nowhere", "--models: nowhere is not a folder"),
        ("-o a.txt", "unknown extension '.txt', wanted one of .json"),
        ("-o no/a.json", "no such folder"),
    ],
)
def test_bad_options_end_in_one_line(capsys, folder, texts, message):
    scene = "" if "--scene" in texts else "--scene tiny "
    assert bench(scene + texts) == 2
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if line.startswith("umbrae: error: ")]
    assert out == "" and len(lines) == 1 and message in lines[0] and err.splitlines()[-1] == lines[0]
