"""Methods, their options and `umbrae verify` on the command line."""

import json
import re
from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image

import umbrae as um
from umbrae import cli
from umbrae.methods.frustum_cpu import Frustum
from umbrae.verify import Truth


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A fresh current folder with a model: a square that hovers one unit above a larger one."""
    monkeypatch.chdir(tmp_path)
    floor = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]
    roof = [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)]
    um.save(um.Scene(floor + roof, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]), "roof.glb")


def umbrae(texts, *more):
    """The exit status of one command line."""
    return cli.run([*texts.split(), *more])


def line(text):
    """The one line on stderr."""
    lines = text.strip().splitlines()
    assert len(lines) == 1, text
    return lines[0]


def pixels(path):
    with Image.open(path) as picture:
        return np.asarray(picture)


def test_verify_passes_an_exact_method(capsys):
    texts = "verify roof.glb --size 64x36 --count 500 --sun 120,40 --light 0,3,0"
    assert umbrae(texts) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 and all("500 samples, 0 wrong outside the band, 0 inside" in text for text in lines)
    assert umbrae(texts, "--json") == 0
    first, second = json.loads(capsys.readouterr().out)["lights"]
    assert first["checked"] == second["checked"] == 500 and first["outside_band"] == 0


@dataclass(frozen=True)
class AllDark(um.Method):
    """Wrong wherever light arrives; its promise is that of the class made of it."""

    refuses: bool = False

    name = "all-dark"
    paper = "none"
    guarantee = um.Guarantee.EXACT

    def prepare(self, scene, clock=None):
        if self.refuses and len(scene.triangles) == 4:  # but not the warm-up's
            raise um.OptionError("not\nthis one")
        return self

    def shadow(self, light, samples, clock=None):
        return um.ShadowMask(np.ones(samples.shape, bool) & samples.covered, self.guarantee)


class Promiseless(AllDark):
    name = "promiseless"
    guarantee = um.Guarantee.NONE


class Refusing(AllDark):
    name = "refusing"

    def __init__(self):
        super().__init__(refuses=True)


ALL = "verify roof.glb --size 64x36 --count 500 --sun 120,40 --method all -q"


def only(monkeypatch, *methods):
    """Leave the oracle, and these."""
    for name in list(um.METHODS):
        if name != "oracle":
            monkeypatch.delitem(um.METHODS, name)
    for method in methods:
        monkeypatch.setitem(um.METHODS, method.name, method)


def test_verify_all_judges_what_can_run_and_names_what_cannot(capsys, monkeypatch):
    only(monkeypatch, Frustum, Refusing, Promiseless)
    found = []
    monkeypatch.setattr(Truth, "find", lambda *texts, find=Truth.find: found.append(1) or find(*texts))
    assert umbrae(ALL) == 0, "one refuses, one promises nothing"
    out, err = capsys.readouterr()
    assert err == "" and len(found) == 1
    title, _, heads, frustum, promiseless, refusing = out.splitlines()
    assert title.startswith("sun towards (") and title.endswith("wrong of 500 samples")
    assert heads.split() == ["method", "guarantee", "band", "band", "margin", "seconds"]
    assert frustum.split()[:5] == ["frustum", "exact", "0", "0", "0"]
    assert promiseless.split()[:2] == ["promiseless", "none"] and int(promiseless.split()[2]) > 0
    assert refusing == "not judged: refusing: not this one"
    assert max(map(len, out.splitlines())) <= 80


def test_verify_all_ends_with_1_for_a_broken_promise(capsys, monkeypatch):
    only(monkeypatch, AllDark, Frustum)
    assert umbrae(ALL, "--light", "0,3,0", "--json") == 1
    facts = json.loads(capsys.readouterr().out)
    assert facts["method"] == "all" and len(facts["lights"]) == 2
    for light in facts["lights"]:
        dark, frustum = light["methods"]
        assert (dark["method"], frustum["method"]) == ("all-dark", "frustum")
        assert dark["outside_band"] == dark["mismatches"] > 0 and dark["guarantee"] == "exact"
        assert frustum["outside_band"] == 0 and frustum["classes"] == {} and frustum["seconds"] > 0
        options = {"light_samples": 32, "culling": True, "front_face_culling": False}
        options |= {"transparency": "exact", "seed": 0}
        assert frustum["options"] == options


def test_verify_all_does_not_hide_bugs(capsys, monkeypatch):
    only(monkeypatch, AllDark)
    monkeypatch.setattr(AllDark, "prepare", lambda *_: 1 / 0)
    assert umbrae(ALL) == 70
    assert line(capsys.readouterr().err).startswith("umbrae: error: ZeroDivisionError")


def test_options_go_to_the_methods_that_have_them_when_all_are_verified(capsys, monkeypatch):
    only(monkeypatch, Frustum)
    assert umbrae(ALL, "--counter", "float") == 2
    assert line(capsys.readouterr().err) == "umbrae: error: no method has an option counter"


@pytest.fixture
def no_opengl(monkeypatch):
    """A machine without OpenGL, whatever this one has."""

    def missing():
        raise um.GraphicsError("libEGL is missing: look elsewhere")

    monkeypatch.setattr("umbrae.methods.volumes.engine.session", missing)
    monkeypatch.setattr("umbrae.methods.shadow_map.method.session", missing)


@pytest.mark.parametrize("method", ["frustum", "smooth"])
def test_no_culling_asks_every_triangle(capsys, method):
    up = "--eye 0,0.5,-3 --target 0,9,-4 --size 32x18 --sun 120,40 --json"  # past the roof, where hardly anything is
    masks = []
    for more in ("", "--no-culling"):
        assert umbrae(f"render roof.glb {up} --method {method} --npz seen.npz {more}") == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["options"]["culling"] is (not more)
        assert (facts["lights"][0]["stats"]["culled"] > 0) is (not more)
        masks.append(np.load("seen.npz")["in_shadow"])
    np.testing.assert_array_equal(*masks)
    assert umbrae("verify roof.glb --size 64x36 --count 500 --sun 120,40 --no-culling") == 0


def test_a_method_that_never_culls_has_no_such_option(capsys):
    assert umbrae("verify roof.glb --method oracle --no-culling") == 2
    assert line(capsys.readouterr().err).startswith("umbrae: error: method oracle has no option culling")


def test_without_opengl_there_is_one_line(capsys, no_opengl):
    for command in ("render", "verify"):
        assert umbrae(f"{command} roof.glb --method silhouette-cpu --size 32x18 -q") == 2
        assert line(capsys.readouterr().err) == "umbrae: error: libEGL is missing: look elsewhere"
    assert umbrae(ALL) == 0
    out = capsys.readouterr().out
    assert "frustum" in out and out.splitlines()[-1].endswith(": libEGL is missing: look elsewhere")


def test_opengl_on_the_command_line(capsys, opengl):
    view = "roof.glb --size 64x36 --sun 120,40 --json"
    assert umbrae(f"render {view} --mask frustum.png") == 0
    assert umbrae(f"render {view} --mask m.png --method silhouette-cpu --counting zfail --counter float") == 0
    plain, facts = (json.loads(text) for text in capsys.readouterr().out.splitlines())
    assert {"counting": "zfail", "counter": "float"}.items() <= facts["options"].items()
    assert facts["guarantee"] == "banded"
    assert facts["lights"][0]["stats"]["zfail"] == 1
    assert {"gpu sides", "sides"} <= set(facts["seconds"])
    for seconds in (plain["seconds"], facts["seconds"]):
        assert seconds["frame"] == sum(seconds[name] for name in ("sample", "shadow", "shade"))
    assert (pixels("m.png") != pixels("frustum.png")).mean() < 0.01
    assert umbrae(f"render {view} --method silhouette-cpu --determinism none") == 0
    assert json.loads(capsys.readouterr().out)["guarantee"] == "none", "what the mask promises, not the method"
    for options, culling in (("", True), ("--no-culling", False)):
        assert umbrae(f"render {view} --method silhouette-gs {options}") == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["options"]["culling"] is culling
        assert ("culled" in facts["lights"][0]["stats"]) is culling
    assert umbrae(f"verify {view} --count 500 --method silhouette-cpu --counting zpass --no-culling") == 0
    (judged,) = json.loads(capsys.readouterr().out)["lights"]
    assert judged["checked"] == 500 and set(judged["classes"]) == {"boundary", "facing away"}
    assert sum(judged["classes"].values()) == judged["mismatches"]


MAP = {"size": 64, "bias": 0.001, "slope_bias": 1.5, "filter": 3, "projection": "single"}


def test_options_of_the_shadow_map(capsys, opengl):
    flags = " ".join(f"--map-{name.replace('_', '-')} {value}" for name, value in MAP.items())
    view = "roof.glb --size 64x36 --light 0,9,0 --json"
    assert umbrae(f"render {view} --method shadow-map {flags} --npz a.npz") == 0
    facts = json.loads(capsys.readouterr().out)
    assert MAP.items() <= facts["options"].items() and facts["lights"][0]["stats"]["texels_per_side"] == 64
    assert umbrae(f"verify {view} --method shadow-map --map-size 2 --count 500") == 0
    (coarse,) = json.loads(capsys.readouterr().out)["lights"]
    assert umbrae(f"verify {view} --method shadow-map --count 500") == 0
    (fine,) = json.loads(capsys.readouterr().out)["lights"]
    assert coarse["mismatches"] > fine["mismatches"]
    assert umbrae(f"{ALL} --map-size 32 --json") == 0


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ("--map-slope-bias 1", "--map-slope-bias is that of --method shadow-map, not frustum"),
        ("--method silhouette-gs --map-size 64", "--map-size is that of --method shadow-map, not silhouette-gs"),
        ("--method shadow-map --map-filter 99", "shadow-map: filter: wanted 1 to 16 texels, got 99"),
        ("--method shadow-map --map-projection flat", "shadow-map: projection: wanted one of auto, single, cube"),
        ("--method shadow-map --map-bias -1", "shadow-map: bias: wanted a number of at least 0, got -1"),
    ],
)
def test_options_of_the_shadow_map_are_refused_in_a_line(capsys, texts, message):
    for command in ("render", "verify"):
        assert umbrae(f"{command} roof.glb -q {texts}") == 2
        assert line(capsys.readouterr().err).startswith(f"umbrae: error: {message}")


def test_the_table_of_methods_fits_into_100_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    assert cli.run(["methods"]) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 100 and "…" not in out
    rows = {text.split()[0]: text for text in out.splitlines() if not text.startswith(" ")}
    assert set(rows) == {"name", *um.METHODS}
    for name, method in um.METHODS.items():
        assert f" {method.engine} " in rows[name] and f" {method.guarantee} " in rows[name]
        assert all(f"{option}={value}" in out for option, value in method().options().items())


def test_verify_ends_with_1_for_a_wrong_method(capsys, monkeypatch):
    def all_dark(scene, light, samples, **_):
        return um.ShadowMask(np.ones(samples.shape, bool), um.Guarantee.EXACT)

    monkeypatch.setattr(um, "shadow", all_dark)
    assert umbrae("verify roof.glb --size 64x36 --count 500 --sun 120,40 -q") == 1
    out, err = capsys.readouterr()
    assert err == "" and re.search(r"500 samples, [1-9]\d* wrong outside the band", out)
    assert not out.rstrip().endswith("worst margin 0")
