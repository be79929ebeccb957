"""The comparators themselves; only where the extras `bench` and `cuda` are installed."""

import importlib.util
from types import SimpleNamespace

import numpy as np
import pytest

import umbrae as um
from umbrae.bench import embree, warp_rays
from umbrae.bench.embree import EmbreexRunner, MitsubaRunner
from umbrae.bench.warp_rays import WarpRunner


def warp_on_the_cpu():
    """Warp's own CPU device traces the same rays by the same kernel."""
    return WarpRunner("cpu")


RUNNERS = [MitsubaRunner, EmbreexRunner, warp_on_the_cpu]


def ready(kind):
    runner = kind()
    missing = runner.unavailable()
    if missing is not None:
        pytest.skip(missing)
    return runner


def tent():
    """A floor with a smaller triangle above it; seen from above the floor, and the light is above both."""
    floor, cover = [(-3, 0, 3), (3, 0, 3), (0, 0, -4)], [(-1, 1, 1), (1, 1, 1.5), (0, 1.25, -1)]
    return um.Scene(floor + cover, [(0, 1, 2), (3, 4, 5)])


@pytest.mark.parametrize("kind", RUNNERS)
@pytest.mark.parametrize("light", [um.Light.point((0.1, 5, 0.2)), um.Light.directional((0.2, -1, 0.1))])
def test_rays_agree_with_the_oracle_but_for_edges(kind, light):
    runner, scene = ready(kind), tent()
    samples = um.sample(scene, um.Camera.look_at((0, 6, 4), (0, 0, 0), width=96, height=54))
    runner.set_geometry(scene)
    runner.set_samples(samples)
    runner.prepare(um.Clock())
    for _ in range(2):
        mask = runner.mask(runner.shadow(light, um.Clock()))
        truth = um.shadow(scene, light, samples, method="oracle").in_shadow
        assert truth.any() and mask.in_shadow.shape == samples.shape and not mask.in_shadow[~samples.covered].any()
        assert (mask.in_shadow != truth).mean() < 0.001


@pytest.mark.parametrize("kind", RUNNERS)
def test_a_surface_shades_its_own_back(kind):
    runner, scene = ready(kind), tent()
    samples = um.ViewSamples.on_surface(scene, [1, 1, 0], [(0.3, 0.3), (0.3, 0.3), (0.1, 0.1)], [1, -1, 1])
    runner.set_geometry(scene)
    runner.set_samples(samples)
    runner.prepare(um.Clock())
    answer = runner.shadow(um.Light.directional((0, -1, 0)), um.Clock())
    assert runner.mask(answer).in_shadow.tolist() == [False, True, False]


@pytest.mark.parametrize("kind", RUNNERS)
def test_no_samples_are_no_rays(kind):
    runner, scene = ready(kind), tent()
    samples = um.sample(scene, um.Camera.look_at((0, 6, 4), (0, 12, 8), width=8, height=4))
    runner.set_geometry(scene)
    runner.set_samples(samples)
    runner.prepare(um.Clock())
    answer = runner.shadow(um.Light.directional((0, -1, 0)), um.Clock())
    assert not runner.mask(answer).in_shadow.any() and not samples.covered.any()


@pytest.mark.parametrize(("kind", "name"), [(MitsubaRunner, "mitsuba"), (EmbreexRunner, "embreex")])
def test_what_is_not_installed_says_how_to_install_it(monkeypatch, kind, name):
    monkeypatch.setattr(embree, "find_spec", lambda wanted: None)
    assert kind().unavailable() == f"{name} is not installed: pip install 'umbrae[bench]'"


def test_warp_wants_to_be_installed_and_a_gpu(monkeypatch):
    monkeypatch.setattr(warp_rays, "find_spec", lambda wanted: None)
    assert WarpRunner().unavailable() == "warp is not installed: pip install 'umbrae[cuda]'"
    monkeypatch.setattr(warp_rays, "find_spec", lambda wanted: importlib.util.find_spec("numpy"))
    monkeypatch.setattr(warp_rays, "_warp", lambda: (SimpleNamespace(get_devices=lambda: ["cpu"]), None))
    assert WarpRunner("cpu").unavailable() is None
    assert "warp finds no device cuda:0: it needs an NVIDIA GPU" in WarpRunner().unavailable()


def test_a_missing_llvm_says_what_to_install(monkeypatch):
    def without():
        raise ImportError('the LLVM backend is inactive because the LLVM shared library ("libLLVM.so") ...')

    monkeypatch.setattr(embree, "find_spec", lambda wanted: importlib.util.find_spec("numpy"))
    monkeypatch.setattr(embree, "_mitsuba", without)
    assert "libLLVM: apt install" in MitsubaRunner().unavailable()


def test_normals_are_unit_vectors_or_nothing():
    scene = um.Scene([(0, 0, 0), (2, 0, 0), (0, 0, 2), (4, 0, 0)], [(0, 1, 2), (0, 1, 3)])
    assert np.array_equal(embree._normals(scene), [(0, -1, 0), (0, 0, 0)])
