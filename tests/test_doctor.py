"""`umbrae doctor`: what works here, and what it says where something does not."""

import json
import tomllib
from pathlib import Path

import pytest

import umbrae as um
from umbrae import cli, doctor
from umbrae.clock import Clock
from umbrae.methods.frustum_cpu import Frustum

ROOT = Path(__file__).parents[1]


@pytest.fixture
def no_opengl(monkeypatch):
    """A machine without OpenGL, whatever this one has."""

    def missing():
        raise um.GraphicsError("the package moderngl is missing: pip install 'umbrae[gl]'")

    monkeypatch.setattr("umbrae.methods.volumes.engine.session", missing)
    monkeypatch.setattr("umbrae.methods.frustum_gl.caster.session", missing)
    monkeypatch.setattr("umbrae.methods.shadow_map.method.session", missing)
    monkeypatch.setattr(doctor, "session", missing)


def test_without_opengl_the_reason_is_told_and_nothing_is_wrong(no_opengl, capsys):
    assert cli.run(["doctor", "-q"]) == 0
    out, err = capsys.readouterr()
    rows = dict(text.split(maxsplit=1) for text in out.splitlines() if len(text.split()) > 1)
    assert err == "" and rows["oracle"].strip() == rows["frustum"].strip() == "ok"
    reason = "the package moderngl is missing: pip install 'umbrae[gl]'"
    assert rows["missing"].strip() == rows["silhouette-cpu"].strip() == reason, "brackets are no markup"
    assert cli.run(["doctor", "--json"]) == 0
    out, err = capsys.readouterr()
    facts = json.loads(out)
    assert err == "" and facts["opengl"] == reason and facts["works"] is True
    assert set(facts["methods"]) == set(um.METHODS)
    works = {name for name, hindrance in facts["methods"].items() if hindrance is None}
    assert works == {"oracle", "frustum", "alias-free-map", "smooth"}
    assert facts["threads"] >= 1 and facts["memory_bytes"] > 0 and facts["kernels_are_cached"] in (True, False)


def test_it_ends_with_1_only_if_the_cpu_fails(no_opengl, capsys, monkeypatch):
    def broken(*_):
        raise RuntimeError("LLVM\nis unwell")

    monkeypatch.setattr(Frustum, "prepare", broken)
    assert cli.run(["doctor"]) == 1
    out, err = capsys.readouterr()
    assert "RuntimeError: LLVM is unwell" in out and "error" not in err
    assert [text.split("  ")[0] for text in err.splitlines()][:2] == ["OpenGL", "compile kernels"]


def test_extras_are_those_of_the_project(no_opengl, monkeypatch, capsys):
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra, packages in doctor.EXTRAS.items():
        assert [text.split(">=")[0] for text in declared[extra]] == list(packages)
    monkeypatch.setattr(doctor, "_version", lambda package: None if package == "cmap" else "9.8.7")
    monkeypatch.setenv("COLUMNS", "120")
    assert cli.run(["doctor", "-q"]) == 0
    out = capsys.readouterr().out
    assert "pvlib 9.8.7, pandas 9.8.7, cmap is missing; pip install 'umbrae[sun]'" in out
    assert "mitsuba 9.8.7, embreex 9.8.7" in out and "umbrae[bench]" not in out


def test_the_driver_and_its_limits(opengl, capsys):
    report = doctor.examine(Clock())
    found = report.opengl
    assert isinstance(found, doctor.OpenGL) and report.works
    assert found.version.startswith("4.") and found.renderer and found.vendor
    # What OpenGL 4.5 guarantees.
    assert found.max_texture_px >= 16384 and found.max_patch_vertices >= 32 and found.max_tessellation_level >= 64
    assert found.max_storage_bytes >= 1 << 24 and found.subpixel_bits >= 4 and found.fp64
    assert found.subgroup_size is None or found.subgroup_size in (1, 2, 4, 8, 16, 32, 64, 128)
    assert found.debug_output, "errors that OpenGL meets must be heard"
    assert report.methods["silhouette-cpu"] is None
    assert cli.run(["doctor", "-q"]) == 0
    assert found.renderer in " ".join(capsys.readouterr().out.split())
