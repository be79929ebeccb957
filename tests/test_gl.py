"""OpenGL: the context in bad and good times, and nothing left behind."""

import ctypes.util
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from umbrae import METHODS, Camera, GraphicsError, Light, Scene, sample, shadow
from umbrae.gl import context
from umbrae.gl.state import count_faces
from umbrae.gl.targets import count_target
from umbrae.sampling import sample_gl

LIGHT = Light.point((3, 4, 5))
DRAWN = [name for name, method in METHODS.items() if method.engine == "OpenGL"]


def soup() -> Scene:
    """Twenty triangles at random."""
    return Scene(np.random.default_rng(0).random((60, 3), dtype=np.float32), np.arange(60).reshape(-1, 3))


def picture(scene: Scene):
    """A tiny picture of the scene."""
    return sample(scene, Camera.frame(scene, width=32, height=24))


def alone(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env={**os.environ, **environment}
    )


# Without a context


@pytest.fixture
def forgotten(monkeypatch):
    """As if no context had been made yet."""
    monkeypatch.setattr(context, "_kept", None)
    monkeypatch.delenv("UMBRAE_GL", raising=False)
    monkeypatch.delenv("UMBRAE_GL_DEVICE", raising=False)


def refusal() -> str:
    """The one line that a caller gets who asks for the context in vain: what is missing, and what works without."""
    with pytest.raises(GraphicsError) as caught:
        context.session()
    line = str(caught.value)
    assert "\n" not in line and len(line) < 300
    return line


def test_switched_off(forgotten, monkeypatch):
    monkeypatch.setenv("UMBRAE_GL", "off")
    assert refusal() == "OpenGL is switched off (UMBRAE_GL=off); the method `frustum` needs no OpenGL"


def test_no_such_way(forgotten, monkeypatch):
    monkeypatch.setenv("UMBRAE_GL", "vulkan")
    assert refusal() == "UMBRAE_GL: wanted egl, glfw or off, got 'vulkan'; the method `frustum` needs no OpenGL"


@pytest.mark.parametrize("package", ["moderngl", "OpenGL"])
def test_python_package_is_missing(forgotten, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    assert re.fullmatch(f".* {package} is missing: pip install 'umbrae.gl.'; .*`frustum`.*", refusal())


@pytest.mark.parametrize(("libraries", "named"), [((), "libEGL"), (("EGL",), "libOpenGL")])
def test_system_library_is_missing(forgotten, monkeypatch, libraries, named):
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: name if name in libraries else None)
    assert re.fullmatch(f"{named} is missing: apt-get install .*libegl1 .*; .*`frustum`.*", refusal())


def test_glfw_is_missing(forgotten, monkeypatch):
    monkeypatch.setenv("UMBRAE_GL", "glfw")
    monkeypatch.setitem(sys.modules, "glfw", None)
    assert re.fullmatch(".*UMBRAE_GL=glfw needs .* glfw: pip install glfw; .*`frustum`.*", refusal())


@pytest.mark.parametrize("device", ["first", "-1", ""])
def test_device_is_no_number(forgotten, monkeypatch, device):
    monkeypatch.setenv("UMBRAE_GL_DEVICE", device)
    expected = f"UMBRAE_GL_DEVICE: wanted the number of a device, got {device!r}; the method `frustum` needs no OpenGL"
    assert refusal() == expected


def test_no_such_device(opengl, forgotten, monkeypatch):
    monkeypatch.setenv("UMBRAE_GL_DEVICE", "77")
    assert re.fullmatch("no OpenGL 4.5 context through egl: .*device index 77.*apt-get .*`frustum`.*", refusal())


def test_a_driver_that_is_too_old_is_refused(opengl, forgotten, monkeypatch):
    monkeypatch.setattr(context, "MINIMUM", 990)
    assert re.fullmatch("no OpenGL 9.9 context through egl: the driver has none; .*apt-get .*`frustum`.*", refusal())


def test_importing_the_shader_methods_wakes_no_driver():
    code = "import sys, umbrae, umbrae.sampling\nassert 'moderngl' not in sys.modules and 'OpenGL' not in sys.modules"
    assert alone(code, UMBRAE_GL="off").returncode == 0


# The context at work


def test_an_opengl_error_is_raised_where_the_context_is_left(opengl):
    with pytest.raises(GraphicsError, match="OpenGL error: GL_INVALID_ENUM"), opengl.current():
        opengl.gl.glEnable(opengl.gl.GL_TRIANGLES)
    with opengl.current():
        pass  # nothing of it is left


def test_a_driver_that_does_not_talk_is_asked(opengl, monkeypatch):
    assert opengl.talks
    monkeypatch.setattr(opengl, "talks", False)
    with pytest.raises(GraphicsError, match="OpenGL error: GL_INVALID_ENUM"), opengl.current():
        opengl.gl.glEnable(opengl.gl.GL_TRIANGLES)
        opengl.messages.clear()
    with opengl.current():
        pass


def test_what_moderngl_refuses_is_a_graphics_error(opengl):
    with pytest.raises(GraphicsError, match="OpenGL error: "), opengl.current():
        opengl.moderngl.buffer(reserve=0)


def test_other_errors_pass_through_and_leave_the_context_usable(opengl):
    with pytest.raises(ZeroDivisionError), opengl.current():
        1 / 0  # noqa: B018
    with opengl.current(), opengl.current():
        pass
    with opengl.current():
        assert opengl.integer("GL_SUBPIXEL_BITS") >= 4


def test_a_draw_call_that_opengl_refuses_is_heard(opengl):
    with opengl.current():
        target = count_target(opengl, 8, 8, stencil=False)
        count_faces(opengl, target, behind=False)
    with pytest.raises(GraphicsError, match="OpenGL error: GL_INVALID"), opengl.current():
        opengl.gl.glDrawArrays(opengl.gl.GL_TRIANGLES, 0, -3)


def test_out_of_memory_says_so(opengl):
    with pytest.raises(GraphicsError, match=r"out of OpenGL memory: .*`frustum`"), opengl.current():
        opengl.messages.append("GL_OUT_OF_MEMORY in glBufferData")


def test_a_picture_too_large_for_the_driver_is_refused_by_name(opengl):
    with opengl.current():
        largest = opengl.integer("GL_MAX_TEXTURE_SIZE")
        with pytest.raises(
            GraphicsError, match=rf"of {largest + 1} x 2 pixels is too large .* {largest} a side; .*`fr"
        ):
            count_target(opengl, largest + 1, 2, stencil=False)


@pytest.mark.usefixtures("opengl")
def test_a_lost_context_is_one_clear_error_and_the_next_call_makes_a_new_one(monkeypatch):
    scene = soup()
    samples = picture(scene)
    mask = shadow(scene, LIGHT, samples, "silhouette-cpu").in_shadow
    before = context.session()
    caster = METHODS["silhouette-cpu"]().prepare(scene)
    with monkeypatch.context() as patched:
        patched.setattr(before.gl, "glGetGraphicsResetStatus", lambda: before.gl.GL_UNKNOWN_CONTEXT_RESET)
        with pytest.raises(GraphicsError, match=r"context was lost .* prepare the scene once more"):
            caster.shadow(LIGHT, samples)
    with pytest.raises(GraphicsError, match="lost or closed: prepare the scene once more"):
        caster.shadow(LIGHT, samples)
    again = shadow(scene, LIGHT, samples, "silhouette-cpu").in_shadow
    assert context.session() is not before
    np.testing.assert_array_equal(again, mask)


@pytest.mark.usefixtures("opengl")
def test_a_closed_context_is_made_anew():
    scene = soup()
    samples = picture(scene)
    masks = []
    for _ in range(3):
        masks.append(shadow(scene, LIGHT, samples, "silhouette-cpu").in_shadow)
        context.close()
    context.close()
    for mask in masks:
        np.testing.assert_array_equal(mask, masks[0])


@pytest.mark.usefixtures("opengl")
def test_threads_take_turns():
    scene = soup()
    samples = picture(scene)
    with ThreadPoolExecutor(4) as pool:
        masks = list(pool.map(lambda _: shadow(scene, LIGHT, samples, "silhouette-cpu").in_shadow, range(24)))
    for mask in masks:
        np.testing.assert_array_equal(mask, masks[0])
    assert masks[0].any()


FORKS = """
import multiprocessing, sys
sys.path.insert(0, "tests")
from test_gl import LIGHT, GraphicsError, picture, shadow, soup

def count(_):
    try:
        return int(shadow(scene, LIGHT, samples, "silhouette-cpu").in_shadow.sum())
    except GraphicsError as error:
        return str(error)

def children():
    with multiprocessing.get_context("fork").Pool(2) as pool:
        return pool.map_async(count, range(4)).get(timeout=60)

scene = soup()
samples = picture(scene)
before = children()
parent = count(0)
assert before == [parent] * 4 and parent > 0, (before, parent)
after = children()
assert all("forked" in said and "spawn" in said and "frustum" in said for said in after), after
assert count(0) == parent
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.usefixtures("opengl")
def test_processes_forked_before_opengl_is_used_have_their_own_and_later_ones_are_told():
    done = subprocess.run(
        [sys.executable, "-c", FORKS],
        cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=150,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# Nothing left behind


def names_alive(session) -> dict[str, int]:
    """How many OpenGL objects there are of each kind, among the first names."""
    gl = session.gl
    with session.current():
        kinds = ("Buffer", "Texture", "Framebuffer", "VertexArray", "Query", "Program", "Shader")
        return {kind: sum(bool(getattr(gl, f"glIs{kind}")(name)) for name in range(1, 3000)) for kind in kinds}


def resident_bytes() -> int:
    """Memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_thousand_frames_and_a_hundred_scenes_leave_nothing_behind(opengl):
    scene = soup()
    samples = picture(scene)
    caster = METHODS["silhouette-cpu"]().prepare(scene)

    def frames(count: int) -> None:
        for _ in range(count):
            caster.shadow(LIGHT, samples)

    def scenes(count: int) -> None:
        for _ in range(count):
            shadow(scene, LIGHT, samples, "silhouette-cpu")

    frames(100)
    scenes(20)
    names, memory = names_alive(opengl), resident_bytes()
    frames(1000)
    scenes(100)
    assert names_alive(opengl) == names
    assert resident_bytes() - memory < 4 << 20


@pytest.mark.parametrize("method", DRAWN)
def test_no_method_leaves_objects_behind(opengl, method):
    scene = soup()
    samples = picture(scene)
    shadow(scene, LIGHT, samples, method)
    names = names_alive(opengl)
    for _ in range(10):
        shadow(scene, LIGHT, samples, method)
    assert names_alive(opengl) == names


def test_visibility_leaves_no_objects_behind(opengl):
    scene = soup()
    camera = Camera.frame(scene, width=32, height=24)
    sample_gl(scene, camera)
    names, memory = names_alive(opengl), resident_bytes()
    for _ in range(200):
        sample_gl(scene, camera, 2)
    assert names_alive(opengl) == names
    assert resident_bytes() - memory < 4 << 20
