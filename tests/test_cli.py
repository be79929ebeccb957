"""The command line as a user meets it: results on stdout, everything else on stderr, one line per error."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

import umbrae as um
from umbrae import cli, models
from umbrae.console import ConsoleClock
from umbrae.outputs import arrays

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A fresh current folder with a model: a square that hovers one unit above a larger one."""
    monkeypatch.chdir(tmp_path)
    floor = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]
    roof = [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)]
    scene = um.Scene(floor + roof, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    um.save(scene, "roof.glb")
    return tmp_path


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


def test_render_alone_writes_a_picture_named_after_the_model(capsys):
    assert cli.run(["render", "roof.glb", "--size", "64x36"]) == 0
    out, err = capsys.readouterr()
    assert out == "roof.png\n"
    assert pixels("roof.png").shape == (36, 64, 3)
    stages = [re.fullmatch(r"(\w[\w ]*?) +\d+\.\d\d s", text) for text in err.splitlines()]
    assert [stage[1] for stage in stages if stage] == [
        *("load", "compile kernels", "sample", "prepare", "shadow", "shade", "write")
    ]
    assert "\x1b" not in err


def test_masks_and_arrays_of_several_lights(capsys):
    texts = "render roof.glb -o a.png --mask m.png --npz a.npz --size 40x40"
    lights = "--light 0.5,9,0 --light 0,-3,0 --sun 90,30"
    assert umbrae(texts, *lights.split(), "--eye", "0,8,0.01", "--target", "0,0,0", "--quiet") == 0
    out, err = capsys.readouterr()
    assert out.split() == ["a.png", "m_1.png", "m_2.png", "m_3.png", "a.npz"] and err == ""
    with np.load("a.npz") as arrays:
        data = dict(arrays)
    assert data["in_shadow"].shape == (3, 40, 40)
    assert data["lights"].tolist()[:2] == [[0.5, 9, 0, 1], [0, -3, 0, 1]]
    assert data["lights"][2] == pytest.approx((3**0.5 / 2, 0.5, 0, 0), abs=1e-6)
    assert data["eye"].tolist() == [0, 8, 0.01] and data["origin"].tolist() == [0, 0, 0]
    assert data["axes"].shape == (3, 3)
    for name, shape in {"barycentric": (40, 40, 2), "position": (40, 40, 3), "depth": (40, 40)}.items():
        assert data[name].shape == shape
    covered, roof = data["covered"], data["triangle"] >= 2
    first, second, third = data["in_shadow"]
    assert covered.any() and roof.any() and not first[~covered].any()
    assert not first[roof].any()  # the roof is lit from above
    assert second[covered].all()  # from below everything is seen from its dark side
    # the sun in the east at 30 degrees throws the roof's shadow sqrt(3) to the west
    floor = covered & ~roof
    x, z = data["position"][floor][:, 0], data["position"][floor][:, 2]
    inside = (x > -1 - 3**0.5) & (x < 1 - 3**0.5) & (np.abs(z) < 1)
    clear = (np.abs(x - (1 - 3**0.5)) > 1e-5) & (np.abs(np.abs(z) - 1) > 1e-5)
    assert (third[floor] == inside)[clear].all() and inside.any() and not inside.all()
    mask = pixels("m_3.png")
    assert ((mask == 0) == third).all() and set(np.unique(mask)) == {0, 255}


def test_one_light_has_one_mask_and_no_extra_axis():
    texts = "render roof.glb --mask m.png --npz a.npz --size 32x18 --samples-per-pixel 4 -q"
    assert umbrae(texts) == 0
    with np.load("a.npz") as data:
        in_shadow = data["in_shadow"]
    assert in_shadow.shape == (18, 32, 4)
    mask = pixels("m.png")
    assert mask.shape == (18, 32)
    assert (mask == np.round(255 * (1 - in_shadow.mean(axis=2)))).all()
    assert len(np.unique(mask)) > 2


def test_smooth_outlines_have_arrays_without_depth(folder, capsys):
    um.save(models.sphere_scene.sphere(segments=8, rings=4), folder / "ball.glb")
    for level, name in ((1, "coarse"), (6, "smooth")):
        assert (
            umbrae(f"render ball.glb -o {name}.png --npz {name}.npz --size 64x64 --smooth-outlines {level} --json") == 0
        )
        assert json.loads(capsys.readouterr().out)["smooth_outlines"] == level
    with np.load("coarse.npz") as coarse, np.load("smooth.npz") as smooth:
        assert set(coarse) - set(smooth) == {"depth"} and set(smooth) < set(coarse)
        assert smooth["covered"].sum() > 1.02 * coarse["covered"].sum()


@pytest.fixture
def pane(folder):
    """A model whose roof is a blue pane."""
    roof = um.load("roof.glb")
    glass = um.Material((0.2, 0.3, 0.9, 0.4), "BLEND")
    um.save(um.Scene(roof.positions, roof.triangles, [um.Material(), glass], [0, 0, 1, 1]), "pane.glb")


ABOVE = ("--eye", "0,6,0.01", "--target", "0,0,0", "--sun", "120,60")


def test_transparent_surfaces_are_layers(pane, capsys):
    assert umbrae("render pane.glb --size 40x40 --json --npz p.npz", *ABOVE) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["layers"] == 2 and facts["stochastic"] is None
    with np.load("p.npz") as data:
        assert data["triangle"].shape == (2, 40, 40) and data["position"].shape == (2, 40, 40, 3)
        assert data["in_shadow"].shape == (2, 40, 40) and "throughput" not in data
        first, second = data["triangle"]
        np.testing.assert_array_equal(second >= 0, first >= 2)
    seen = pixels("pane.png")
    assert umbrae("render pane.glb --size 40x40 --layers 1 --npz p.npz -o one.png -q", *ABOVE, "--light", "0,9,0") == 0
    with np.load("p.npz") as data:
        assert data["triangle"].shape == (40, 40) and data["in_shadow"].shape == (2, 40, 40)
        np.testing.assert_array_equal(data["triangle"], first)
    assert (pixels("one.png")[20, 20] != seen[20, 20]).any()
    capsys.readouterr()
    assert umbrae("render pane.glb --size 40x40 --layers 2 --json", *ABOVE) == 0
    assert "as many layers as there may be, 2" in capsys.readouterr().err


def test_chance_and_its_seed(pane, capsys):
    pictures = []
    for more in ("", "--seed 0", "--seed 5"):
        command = "render pane.glb --size 40x40 --samples-per-pixel 4 --stochastic --json --npz p.npz"
        assert umbrae(f"{command} {more}", *ABOVE) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["layers"] == 1 and facts["stochastic"] == int(more[-1:] or 0)
        pictures.append(pixels("pane.png").tobytes())
        with np.load("p.npz") as data:
            assert data["throughput"].shape == (40, 40, 4, 3) and data["triangle"].shape == (40, 40, 4)
            share = (data["triangle"] >= 2)[18:22, 18:22].mean()
        assert 0.2 < share < 0.6  # 0.4 of the pane is opaque
    assert pictures[0] == pictures[1] != pictures[2]


@pytest.mark.parametrize(
    "options", ["--samples-per-pixel 4 --stochastic --seed 5", "--antialiasing derivative --filter-width 3"]
)
@pytest.mark.usefixtures("opengl")
def test_the_frustum_method_on_opengl_draws_the_same_picture(pane, options):
    for method in ("frustum", "frustum-gl"):
        command = f"render pane.glb --size 40x40 -q --method {method} -o {method}.png --mask {method}-mask.png"
        assert umbrae(f"{command} {options}", *ABOVE) == 0
    np.testing.assert_array_equal(pixels("frustum-gl.png"), pixels("frustum.png"))
    mask = pixels("frustum-gl-mask.png")
    np.testing.assert_array_equal(mask, pixels("frustum-mask.png"))
    assert len(np.unique(mask)) > 3


def test_shares_of_light_are_stored():
    """With layers first, then lights, then the samples' shape, then channels; each only where there are several."""
    scene = um.load("roof.glb")
    camera = um.Camera.frame(scene, width=8, height=6)
    samples = um.sample(scene, camera)
    whole = um.ShadowMask(np.zeros(samples.shape, bool), um.Guarantee.EXACT)
    half = um.ShadowMask(whole.in_shadow, whole.guarantee, partial=np.full((6, 8, 3), 0.5, np.float32))
    sun, picture = um.Light.sun(1, 2), np.zeros((6, 8, 3), np.uint8)

    def stored(*layers):
        image = um.Image(picture, samples, layers[0], (samples,) * (len(layers) - 1), layers[1:])
        return arrays(scene, [sun] * len(layers[0]), image)

    assert "transmittance" not in stored((whole,), (whole,))
    assert stored((half,))["transmittance"].shape == (6, 8, 3)
    found = stored((whole, half), (half, half), (whole, whole))
    assert found["transmittance"].shape == (3, 2, 6, 8, 3) and found["in_shadow"].shape == (3, 2, 6, 8)
    assert found["transmittance"].mean(axis=(2, 3, 4)).tolist() == [[1, 0.5], [0.5, 0.5], [1, 1]]
    assert found["depth"].shape == (3, 6, 8)


def test_json_is_one_object_and_nothing_else(capsys):
    assert umbrae("render roof.glb --size 64x36 --json --mask m.png") == 0
    out, err = capsys.readouterr()
    facts = json.loads(out)
    assert err == ""
    assert facts["triangles"] == 4 and facts["size"] == [64, 36] and facts["samples"] == 64 * 36
    assert facts["method"] == "frustum" and facts["guarantee"] == "exact"
    assert {"load", "sample", "prepare", "shadow", "shade", "write"} <= set(facts["seconds"])
    assert facts["picture"] == "roof.png" and facts["masks"] == ["m.png"] and facts["npz"] is None
    dark = int((pixels("m.png") == 0).sum())
    assert facts["lights"][0]["in_shadow"] == dark > 0
    assert all(isinstance(count, int) for count in facts["lights"][0]["stats"].values())


def test_coordinates_of_options_are_the_files_own(capsys):
    """A model near x = 5,000,000: eye, target and light are given there; the picture is the one near zero."""
    near = "v 0 0 0\nv 4 0 0\nv 0 0 -4.125\nv 1 1 -1\nv 2 1 -1\nv 1 1 -2.0625\nf 1 2 3\nf 4 5 6\n"
    far = re.sub(r"^v (\S+)", lambda match: f"v {5_000_000.03125 + float(match[1])}", near, flags=re.MULTILINE)
    for name, text, shift in (("near", near, 0.0), ("far", far, 5_000_000.03125)):
        Path(f"{name}.obj").write_text(text)
        places = [
            "--eye",
            f"{shift + 2},6,3",
            "--target",
            f"{shift + 1},0,-1",
            "--light",
            f"{shift + 2},5,-2",
        ]
        assert cli.run(["render", f"{name}.obj", "--size", "48x48", "--mask", f"{name}_mask.png", "-q", *places]) == 0
        err = capsys.readouterr().err
        if name == "far":
            assert line(err).startswith("umbrae: note: coordinates far from zero")
        else:
            assert err == ""
    masks = [pixels(f"{name}_mask.png") for name in ("near", "far")]
    assert (masks[0] == 0).any()
    assert (masks[0] != masks[1]).mean() < 0.005  # the eye is rounded elsewhere


def test_automatic_cameras(capsys):
    scene = um.load("roof.glb")
    framed = um.Camera.frame(scene, width=32, height=18)
    where = {}
    for name, texts in {"target": ["--target", "0,1,0.5"], "eye": ["--eye", "3,3,3"], "none": []}.items():
        assert cli.run(["render", "roof.glb", "--size", "32x18", "--npz", f"{name}.npz", "-q", *texts]) == 0
        with np.load(f"{name}.npz") as data:
            where[name] = (data["eye"], data["axes"][2])
    assert where["none"][0] == pytest.approx(framed.eye)
    assert where["target"][1] == pytest.approx(framed.axes[2])  # same direction
    to_target = np.array([0, 1, 0.5]) - where["target"][0]
    assert to_target / np.linalg.norm(to_target) == pytest.approx(where["target"][1])
    assert where["eye"][0].tolist() == [3, 3, 3]
    assert where["eye"][1] == pytest.approx(np.array([-3, -2.5, -3]) / np.linalg.norm([3, 2.5, 3]))


def test_materials_that_let_light_through_need_no_word(capsys):
    glass = um.Material((1, 0, 0, 0.5), alpha_mode="BLEND")
    um.save(um.Scene([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], [glass]), "glass.glb")
    assert cli.run(["render", "glass.glb", "--size", "8x8", "-q"]) == 0
    assert capsys.readouterr().err == ""


BAD = {
    "render nowhere.glb": "nowhere.glb: no such file",
    "render roof.glb --eye 1,2": "'--eye': wanted three numbers x,y,z, got '1,2'",
    "render roof.glb --target 1,2,nan": "'--target': wanted three numbers x,y,z, got '1,2,nan'",
    "render roof.glb --light 1,2,3,4": "'--light': wanted three numbers x,y,z, got '1,2,3,4'",
    "render roof.glb --sun 120": "'--sun': wanted two numbers azimuth,elevation in degrees, got '120'",
    "render roof.glb --sun 120,91": "wanted an elevation of -90 to 90 degrees, got 91",
    "render roof.glb --size 1920": "'--size': wanted two whole numbers such as 1920x1080, got '1920'",
    "render roof.glb --size 0x9": "'--size': wanted two whole numbers of at least 1, got '0x9'",
    "render roof.glb --size 99999x9": "wanted 1 to 65536 pixels, got 99999",
    "render roof.glb --size 65536x65536": "GiB",
    "render roof.glb --up x": "'--up': wanted y, z or three numbers x,y,z, got 'x'",
    "render roof.glb --up 0,0,0": "'--up': wanted a vector that is not zero",
    "render roof.glb --fov 180": "wanted degrees between 0 and 180, got 180",
    "render roof.glb --eye 1,2,3 --target 1,2,3": "eye and target are the same point",
    "render roof.glb --method frustrum": "unknown method 'frustrum'; did you mean 'frustum'? (known: oracle",
    "render roof.glb --samples-per-pixel 0": "'--samples-per-pixel'",
    "render roof.glb --antialiasing msaa": "antialiasing: wanted one of samples, derivative, got 'msaa'",
    "render roof.glb --antialiasing derivative --samples-per-pixel 4": "takes one sample per pixel, got 4",
    "render roof.glb --antialiasing derivative --filter-width 0": "wanted a number of pixels > 0, got 0.0",
    "render roof.glb --filter-width 2": "--filter-width is that of --antialiasing derivative, which is not there",
    "render roof.glb --light-samples 8": "--light-samples: wanted a light with a size",
    "render roof.glb --layers 3 --stochastic --samples-per-pixel 4": "--layers: --stochastic sees through all surfaces",
    "render roof.glb --method silhouette-cpu --show count --sun-diameter 1": "--show count: wanted a light without",
    "render roof.glb --light-radius 2": "--light-radius: wanted a point light (--light)",
    "render roof.glb --layers 0": "'--layers'",
    "render roof.glb --smooth-outlines 0": "'--smooth-outlines'",
    "render roof.glb --smooth-outlines 99": "smooth outlines: wanted a level of 1 to 64, got 99",
    "render roof.glb --smooth-outlines 3 --layers 2": "--layers: --smooth-outlines sees solid surfaces only",
    "render roof.glb --smooth-outlines 3 --antialiasing derivative": "do not go with antialiasing 'derivative'",
    "render roof.glb --smooth-outlines 3 --stochastic --samples-per-pixel 4": "do not go with a stochastic picture",
    "render roof.glb --method silhouette-cpu --show count --smooth-outlines 3": "has no --smooth-outlines",
    "render roof.glb --seed 3": "--seed chooses the chances of --stochastic, which is not there",
    "render roof.glb --stochastic": "--stochastic: wanted --samples-per-pixel above 1",
    "render roof.glb --stochastic --seed -1 --samples-per-pixel 4": "'--seed'",
    "render roof.glb --method silhouette-cpu --show count --stochastic --samples-per-pixel 4": "has no --stochastic",
    "render roof.glb --counting zpass": "method frustum has no option counting (it has: light_samples, ",
    "render roof.glb --method silhouette-cpu --counting zpas": "wanted one of auto, zpass, zfail, got 'zpas'",
    "render roof.glb --method silhouette-cpu --counter x": "wanted one of auto, stencil, float, got 'x'",
    "render roof.glb --method oracle --determinism none": "method oracle has no option determinism (it has: light",
    "render roof.glb --show count": "--show count: method frustum has no volumes (these have: silhouette-cpu",
    "render roof.glb --method silhouette-cpu --show lines": "'--show': wanted count or volumes, got 'lines'",
    "render roof.glb --method silhouette-cpu --show count --sun 1,2 --light 1,2,3": "wanted one light, got 2",
    "render roof.glb --method silhouette-cpu --show volumes --samples-per-pixel 2": "such as 1, 4 or 9, got 2",
    "render roof.glb --method silhouette-cpu --show volumes --mask m.png": "has no --mask and no --npz",
    "render roof.glb --method silhouette-cpu --show count --size 64x18": "more than 18 pixels of height",
    "render roof.glb -o nowhere/out.png": "nowhere/out.png: no such folder",
    "render roof.glb -o out.xyz": "out.xyz: unknown extension '.xyz'",
    "render roof.glb --npz out.txt": "out.txt: unknown extension '.txt'",
    "render roof.glb -o a.png --mask ./a.png": "a.png: would overwrite another output",
    "render picture.png -o picture.png": "picture.png: no such file",
    "render roof.glb --sice 9x9": "No such option: --sice",
    "render": "Missing argument 'MODEL'",
    "rendre": "No such command 'rendre'",
    "scene": "Missing command",
    "scene spheres --triangles 3": "got 3",
    "scene spheres --grid 10": "'--grid': wanted two whole numbers",
    "scene pavilion -o out.png": "out.png: unknown extension '.png'",
    "verify roof.glb --count 0": "'--count'",
    "verify roof.glb --method al": "unknown method 'al'",
    "verify roof.glb --method frustum --counter float": "method frustum has no option counter",
    "verify roof.glb --method all --counter doubles": "wanted one of auto, stencil, float, got 'doubles'",
    "doctor roof.glb": "unexpected extra argument",
    "info folder": "is not a file",
}


@pytest.mark.parametrize("texts", BAD)
def test_bad_input_is_one_line_and_status_2(texts, capsys, folder):
    (folder / "folder").mkdir()
    before = sorted(folder.iterdir())
    assert umbrae(texts, *(["-q"] if texts.startswith("render ") else [])) == 2
    out, err = capsys.readouterr()
    assert out == ""
    last = err.strip().splitlines()[-1]
    assert last.startswith("umbrae: error: ") and BAD[texts] in last
    assert sum("error" in text for text in err.splitlines()) == 1
    assert sorted(folder.iterdir()) == before


def test_interruption_and_bugs_are_one_line_each(capsys, monkeypatch):
    monkeypatch.delenv("UMBRAE_DEBUG", raising=False)

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    def broken(*_, **__):
        raise ZeroDivisionError("of\nall things")

    monkeypatch.setattr(um, "load", interrupted)
    assert cli.run(["info", "roof.glb"]) == 130
    assert line(capsys.readouterr().err) == "umbrae: error: interrupted"
    monkeypatch.setattr(um, "load", broken)
    assert cli.run(["info", "roof.glb"]) == 70
    said = line(capsys.readouterr().err)
    assert said.startswith("umbrae: error: ZeroDivisionError: of all things") and "UMBRAE_DEBUG=1" in said
    monkeypatch.setenv("UMBRAE_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        cli.run(["info", "roof.glb"])


@pytest.mark.parametrize("texts", ["", "-o other.png --mask skin.png"])
def test_a_texture_of_the_model_is_never_overwritten(texts, capsys, folder):
    Image.new("RGB", (2, 2), "red").save("skin.png")
    (folder / "skin.mtl").write_text("newmtl red\nmap_Kd skin.png\n")
    (folder / "skin.obj").write_text("mtllib skin.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    before = (folder / "skin.png").read_bytes()
    assert umbrae(f"render skin.obj --size 16x9 -q {texts}") == 2
    assert "skin.png: would overwrite the model's texture" in line(capsys.readouterr().err)
    assert (folder / "skin.png").read_bytes() == before
    assert umbrae("render skin.obj --size 16x9 -q -o other.png") == 0


def umbrae_process(*texts, **more):
    command = [sys.executable, "-m", "umbrae", *texts]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)


@pytest.mark.parametrize(
    ("number", "status", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_a_signal_while_writing_leaves_nothing_behind(number, status, word, folder):
    before = sorted(folder.iterdir())
    process = umbrae_process("render", "roof.glb", "--size", "3000x2000", "-q", "-o", "large.png")
    try:
        deadline = time.monotonic() + 60
        while not list(folder.glob(".*.part")):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        process.send_signal(number)
        _, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == status
    assert line(err) == f"umbrae: error: {word}"
    assert sorted(folder.iterdir()) == before


def test_an_interruption_while_compiling_is_heard_at_once(folder, tmp_path):
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cold")}
    process = umbrae_process("render", "roof.glb", "--size", "64x36", env=env)
    try:
        for text in process.stderr:
            if text.startswith("umbrae: note: first run"):
                break
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        _, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 130
    assert line(err) == "umbrae: error: interrupted"
    assert time.monotonic() - start < 5


def test_a_full_disk_behind_stdout_is_no_bug(folder):
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "umbrae", "info", "roof.glb", "--json"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2
    assert line(done.stderr).startswith("umbrae: error: cannot print the results")


@pytest.mark.parametrize("command", ["render", "verify"])
def test_a_camera_that_looks_away_is_noted(command, capsys):
    assert umbrae(f"{command} roof.glb --size 32x18 -q --eye 0,9,0 --target 0,20,0") == 0
    assert line(capsys.readouterr().err) == "umbrae: note: the camera sees nothing of the model"


def test_scenes_of_our_own(capsys):
    assert umbrae("scene spheres --grid 3x2 --triangles 602 -o s.glb") == 0
    assert cli.run(["scene", "pavilion"]) == 0
    assert capsys.readouterr().out.split() == ["s.glb", "pavilion.glb"]
    assert len(um.load("s.glb").triangles) == len(models.spheres((3, 2), 602).triangles)
    assert len(um.load("pavilion.glb").triangles) == len(models.pavilion().triangles)


def test_info_methods_version_and_help(capsys):
    assert cli.run(["info", "roof.glb"]) == 0
    assert "8 with one triangle, 2 with two, 0 with more" in capsys.readouterr().out
    assert cli.run(["info", "roof.glb", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["edges_1"] == 8 and err == ""
    assert cli.run(["methods"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in um.METHODS) and "Sintorn" in out
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out == f"umbrae {um.__version__}\n"
    assert cli.run([]) == 0
    assert "render" in capsys.readouterr().out


def test_demo_shows_the_pavilions_own_view(monkeypatch):
    """The options in the Makefile are the camera and the light that the scene comes with."""
    options = re.search(r"^PAVILION = (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    options[options.index("--samples-per-pixel") + 1] = "1"
    assert cli.run(["scene", "pavilion", "-o", "p.glb"]) == 0
    assert cli.run(["render", "p.glb", "-q", "--npz", "p.npz", "--size", "64x36", *options]) == 0
    camera = models.pavilion_camera(64, 36)
    with np.load("p.npz") as data:
        assert data["eye"] == pytest.approx(camera.eye) and data["axes"] == pytest.approx(camera.axes)
        assert (data["lights"] == models.pavilion_light().position).all()
        depth = data["depth"]
    assert depth.shape == (2, 36, 64)  # what is seen through the glass comes after it
    depth = depth[0]
    assert (depth == um.sample(models.pavilion(), camera).depth).mean() > 0.99


def test_as_a_process_without_a_terminal(folder):
    """`python -m umbrae` in a pipe: lines without control codes, and a traceback-free end."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "umbrae", "render", "roof.glb", "--size", "16x9"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=folder, check=False)
    assert done.returncode == 0 and done.stdout == "roof.png\n"
    assert "\x1b" not in done.stderr and "\r" not in done.stderr and "shadow" in done.stderr


def terminal(**options):
    return Console(file=io.StringIO(), width=80, highlight=False, **options)


def test_clock_prints_outermost_spans_only():
    console = terminal()
    clock = ConsoleClock(console)
    with clock.span("outer"), clock.span("inner"):
        clock.advance(1, 2)
    with pytest.raises(ValueError), clock.span("failed"):
        raise ValueError
    assert re.fullmatch(r"outer +0\.00 s\n", console.file.getvalue())
    assert [name for name, _ in clock.spans] == ["inner", "outer", "failed"]


def test_clock_shows_a_bar_only_for_long_spans(monkeypatch):
    monkeypatch.setattr("umbrae.console.BAR_AFTER_SECONDS", 0.05)
    console = terminal(force_terminal=True)
    clock = ConsoleClock(console)
    with clock.span("short"):
        pass
    time.sleep(0.1)
    assert re.fullmatch(r"short +0\.00 s\n", console.file.getvalue())
    with clock.span("long"):
        time.sleep(0.2)
        with clock.span("part"):
            clock.advance(1, 4)
            time.sleep(0.2)
    text = console.file.getvalue()
    assert "long · part" in text and "25%" in text
    assert re.search(r"long +0\.\d\d s\n$", text)


def test_a_failed_span_takes_its_bar_away(monkeypatch):
    monkeypatch.setattr("umbrae.console.BAR_AFTER_SECONDS", 0.02)
    console = terminal(force_terminal=True)
    clock = ConsoleClock(console)
    with pytest.raises(KeyboardInterrupt), clock.span("long"):
        time.sleep(0.1)
        raise KeyboardInterrupt
    assert clock._bar is None and clock._timer is None
    assert console.file.getvalue().endswith("\x1b[2K")
