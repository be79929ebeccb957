"""`umbrae render --frames`: pictures by number, clips, and going on after an interruption."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import umbrae as um
from animated import TRIANGLE, arm, turning
from umbrae import cli, files
from umbrae.commands.film import Film, Frames, frames_of

FRAMES = "render turn.gltf --size 48x32 --sun 30,60 -q --fps 4"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A fresh current folder with a triangle that turns for two seconds, and one that stands still."""
    monkeypatch.chdir(tmp_path)
    turning(tmp_path / "turn.gltf")
    um.save(um.Scene(TRIANGLE, [[0, 1, 2]]), "still.glb")
    return tmp_path


def umbrae(texts, *more):
    return cli.run([*texts.split(), *more])


def pixels(path):
    with Image.open(path) as picture:
        return np.asarray(picture)


def names(pattern="*.png"):
    return sorted(path.name for path in Path().glob(pattern))


def error(capsys):
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1
    return err.strip().removeprefix("umbrae: error: ")


def test_a_picture_for_every_frame(capsys):
    assert umbrae(FRAMES, "--frames", "2:9:3", "-o", "f_%03d.png") == 0
    out, err = capsys.readouterr()
    assert out.split() == ["f_002.png", "f_005.png", "f_008.png"] == names() and err == ""
    for number in (2, 5, 8):
        assert pixels(f"f_{number:03d}.png").shape == (32, 48, 3)
    # Frame 8 is that of second 2, where the animation starts over.
    assert umbrae(FRAMES, "--frames", "0:1", "-o", "g%d.png") == 0
    np.testing.assert_array_equal(pixels("g0.png"), pixels("f_008.png"))
    assert (pixels("f_002.png") != pixels("f_005.png")).any()


def test_frames_are_the_moments_of_the_animation():
    animation = um.load_animation("turn.gltf")
    assert umbrae(FRAMES, "--frames", "0:8", "--eye", "0,0,9", "--target", "0,0,0") == 0
    assert names() == [f"turn_{number:04d}.png" for number in range(8)]
    camera, light = um.Camera.look_at((0, 0, 9), (0, 0, 0), width=48, height=32), um.Light.sun(30, 60)
    for number in (0, 3, 7):
        image = um.render(animation.at(number / 4), camera, light)
        np.testing.assert_array_equal(pixels(f"turn_{number:04d}.png"), image.pixels)


def test_all_frames_are_in_view(folder):
    animation = um.load_animation(arm(folder / "arm.gltf"))
    for orbit in (0.0, 90.0):
        film = Film(Frames(0, 40, 1), Path("f%d.png"), 10.0, orbit)
        stage = film.stage(animation.scene, animation, (0, 1, 0))
        camera = um.Camera.frame(stage, width=90, height=60)
        middle = stage.bounds.astype(float).mean(axis=0)
        largest = 0.0
        for number in range(40):
            view = camera.turned(middle, (0, 1, 0), orbit * number / 10)
            points = animation.at(number / 10 % 1.0).positions
            x, y, w = view.world_to_clip @ np.column_stack([points, np.ones(len(points))]).T
            largest = max(largest, float(np.abs([x / w, y / w]).max()))
        assert 0.85 < largest <= 1.0


def test_what_is_there_is_not_made_again(capsys):
    assert umbrae(FRAMES, "--frames", "0:3", "-o", "f%d.png") == 0
    capsys.readouterr()
    before = {name: os.stat(name).st_mtime_ns for name in names()}
    data = Path("f1.png").read_bytes()
    Path("f1.png").write_bytes(data[:-20] + bytes(20))
    assert umbrae(FRAMES, "--frames", "0:5", "-o", "f%d.png") == 0
    out, err = capsys.readouterr()
    assert len(out.split()) == 5 and err == "umbrae: note: 2 of 5 frames were there already\n"
    assert [os.stat(name).st_mtime_ns == before[name] for name in ("f0.png", "f1.png", "f2.png")] == [True, False, True]
    assert Path("f1.png").read_bytes() == data


@pytest.mark.parametrize(
    "change", [["--sun", "90,20"], ["--size", "48x30"], ["--fps", "5"], ["--orbit", "7"], ["model"]]
)
def test_other_pictures_are_made_anew(change, capsys):
    assert umbrae(FRAMES, "--frames", "1:4", "-o", "f%d.png") == 0
    if change == ["model"]:
        Path("turn.gltf").write_text(Path("turn.gltf").read_text() + " ")
        change = []
    capsys.readouterr()
    assert umbrae(FRAMES, "--frames", "1:4", "-o", "f%d.png", *change, "--json") == 0
    assert (json.loads(capsys.readouterr().out)["made"]) == 3


def interrupted_at(monkeypatch, count):
    """Let Ctrl-C come while picture number `count` is written."""
    written, save = [], files.save_image

    def save_or_stop(path, *more):
        if len(written) == count:
            raise KeyboardInterrupt
        written.append(path)
        save(path, *more)

    monkeypatch.setattr(files, "save_image", save_or_stop)


def test_an_interruption_keeps_what_is_there(monkeypatch, capsys):
    with monkeypatch.context() as patched:
        interrupted_at(patched, 2)
        assert umbrae(FRAMES, "--frames", "0:6", "-o", "f%d.png") == 130
    out, err = capsys.readouterr()
    assert out == "" and err.splitlines() == [
        "umbrae: note: 2 of 6 frames are there: the same command makes the others",
        "umbrae: error: interrupted",
    ]
    assert names() == ["f0.png", "f1.png"]
    assert umbrae(FRAMES, "--frames", "0:6", "-o", "f%d.png", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["made"], facts["kept"], facts["duration"]) == (4, 2, 2.0)
    assert facts["written"] == [f"f{number}.png" for number in range(6)] and facts["animation"] == "turn"


def test_a_signal_stops_the_process(folder):
    command = [sys.executable, "-m", "umbrae", *FRAMES.split(), "--frames", "0:2000", "-o", "f%d.png"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 120
        while len(names()) < 3:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 130 and err.splitlines()[-1] == "umbrae: error: interrupted"
    there = names()
    assert err.startswith(f"umbrae: note: {len(there)} of 2000 frames are there")
    assert list(folder.glob(".*")) == [] and all(pixels(name).shape == (32, 48, 3) for name in there)


def test_a_clip(monkeypatch, capsys, folder):
    imageio = pytest.importorskip("imageio.v3")
    pytest.importorskip("av")
    with monkeypatch.context() as patched:
        interrupted_at(patched, 3)
        assert umbrae(FRAMES, "--frames", "0:7", "-o", "clip.mp4") == 130
    assert not Path("clip.mp4").exists() and len(list(folder.glob(".clip.mp4.frames/*.png"))) == 3
    capsys.readouterr()
    assert umbrae(FRAMES, "--frames", "0:7", "-o", "clip.mp4") == 0
    out, err = capsys.readouterr()
    assert out == "clip.mp4\n" and err == "umbrae: note: 3 of 7 frames were there already\n"
    assert sorted(path.name for path in folder.iterdir()) == ["clip.mp4", "still.glb", "turn.gltf"]
    found = imageio.imread("clip.mp4", plugin="pyav")
    assert found.shape == (7, 32, 48, 3)
    assert imageio.immeta("clip.mp4", plugin="pyav")["fps"] == 4
    assert umbrae(FRAMES, "--frames", "0:7", "-o", "f%d.png") == 0
    for number in range(7):
        # H.264 is lossy, but each frame is nearest to its own picture.
        off = [np.abs(found[number].astype(int) - pixels(f"f{other}.png")).mean() for other in range(7)]
        assert int(np.argmin(off)) == number


def test_clips_need_what_writes_them(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "av", None)
    assert umbrae(FRAMES, "--frames", "0:2", "-o", "clip.mp4") == 2
    assert error(capsys).startswith("clips need imageio and PyAV: pip install 'umbrae[video]'")


def test_the_camera_goes_around_what_stands_still(capsys):
    texts = "render still.glb --size 48x32 -q --frames 0:4 --fps 4 --orbit 360 -o s%d.png"
    assert umbrae(texts, "--eye", "2,1,5", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["made"], facts["orbit"], facts["animation"], facts["duration"]) == (4, 360.0, None, 0.0)
    scene = um.load("still.glb")
    middle = scene.bounds.astype(float).mean(axis=0)
    camera = um.Camera.look_at((2, 1, 5), middle, width=48, height=32).turned(middle, (0, 1, 0), 180)
    np.testing.assert_allclose(camera.eye, [2 * middle[0] - 2, 1, 2 * middle[2] - 5], 0, 1e-12)
    sun = um.render(scene, um.Camera.look_at((2, 1, 5), middle, width=48, height=32))
    np.testing.assert_array_equal(pixels("s0.png"), sun.pixels)
    assert (pixels("s0.png") != pixels("s2.png")).any()


def test_a_camera_turns_counter_clockwise():
    camera = um.Camera.look_at((5, 0, 0), (1, 0, 0)).turned((1, 0, 0), (0, 0, 2), 90)
    np.testing.assert_allclose(camera.eye, [1, 4, 0], 0, 1e-12)
    np.testing.assert_allclose(camera.axes[2], [0, -1, 0], 0, 1e-12)


@pytest.mark.parametrize(("text", "wanted"), [("0:120", (0, 120, 1)), ("5:6", (5, 6, 1)), ("0:100:25", (0, 100, 25))])
def test_frames_are_named(text, wanted):
    assert frames_of(text) == wanted


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ("turn.gltf --frames 5:5", "wanted frames A:B or A:B:STEP"),
        ("turn.gltf --frames 0:4:0", "wanted frames A:B or A:B:STEP"),
        ("turn.gltf --frames 0:999999999", "wanted up to 100000 frames"),
        ("turn.gltf --frames -1:5", "wanted frames A:B or A:B:STEP"),
        ("turn.gltf --frames 0:4 -o a.png", "wanted a name with a number such as frame_%04d.png, or clip.mp4"),
        ("turn.gltf --frames 0:4 -o a%d_%d.png", "wanted a name with a number"),
        ("turn.gltf --frames 0:4 -o a%d.jpg", "wanted a name with a number"),
        ("turn.gltf --frames 0:4 -o no/a%d.png", "no such folder"),
        ("turn.gltf --frames 0:4 --mask m.png", "--mask: --frames makes pictures or a clip and nothing else"),
        ("turn.gltf --frames 0:4 --npz a.npz", "--npz: --frames makes"),
        ("turn.gltf --frames 0:4 --smooth-normals 30", "--smooth-normals: --frames makes"),
        ("turn.gltf --frames 0:4 --fps 0", "--fps: wanted a number above 0, up to 1000, got 0.0"),
        ("turn.gltf --frames 0:4 --fps nan", "--fps: wanted a number above 0"),
        ("turn.gltf --frames 0:4 --orbit inf", "--orbit: wanted degrees per second"),
        ("turn.gltf --frames 0:4 --animation run", "has no animation 'run', wanted one of: turn"),
        ("still.glb --frames 0:4", "still.glb has no animations, so nothing moves (--orbit: the camera)"),
        ("still.glb --frames 0:4 --animation run", "has no animations"),
        ("turn.gltf --fps 30", "--fps is that of --frames, which is not there"),
        ("turn.gltf --orbit 30", "--orbit is that of --frames"),
        ("turn.gltf --animation turn", "--animation is that of --frames"),
        ("turn.gltf --frames 0:4 -o clip.mp4 --size 31x20", "--size: clips take even numbers of pixels, got 31x20"),
    ],
)
def test_what_cannot_be_filmed(texts, message, capsys, folder):
    before = sorted(folder.iterdir())
    assert umbrae(f"render {texts} -q") == 2
    assert message in error(capsys)
    assert sorted(folder.iterdir()) == before


def test_a_folder_for_frames_that_cannot_be_made_is_named(capsys, folder, monkeypatch):
    pytest.importorskip("av")

    def refuse(self: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert umbrae("render turn.gltf --frames 0:2 --size 32x32 -o clip.mp4 -q") == 2
    assert ".clip.mp4.frames: the frames' folder cannot be made: Permission denied" in error(capsys)
