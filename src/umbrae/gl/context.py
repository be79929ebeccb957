"""The one OpenGL context of this process, made when it is first asked for and kept.

`UMBRAE_GL` chooses how: `egl` (the default) needs no window system, `glfw` opens a hidden window, `off` refuses.
`UMBRAE_GL_DEVICE` is the number of the EGL device, where there are several.
"""

import ctypes
import ctypes.util
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from umbrae.errors import GraphicsError

MINIMUM = 450
WAY_OUT = "the method `frustum` needs no OpenGL"
_INSTALL_PYTHON = "pip install 'umbrae[gl]'"
_INSTALL_SYSTEM = "apt-get install libegl1 libopengl0 libgl1-mesa-dri"

_BAD_MATCH = "0x3009"  # of EGL: the driver knows no such context
_ERRORS = {
    0x0500: "GL_INVALID_ENUM",
    0x0501: "GL_INVALID_VALUE",
    0x0502: "GL_INVALID_OPERATION",
    0x0505: "GL_OUT_OF_MEMORY",
    0x0506: "GL_INVALID_FRAMEBUFFER_OPERATION",
}

_lock = threading.RLock()
_kept: "Session | None" = None
_process: int | None = None  # which one has woken the driver


def _after_fork() -> None:
    """In the child: a thread that held the lock is not there to give it back."""
    global _lock
    _lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


@dataclass(eq=False)
class Session:
    """An OpenGL context with everything that is kept for it.

    Attributes
    ----------
    moderngl
        The `moderngl.Context`: buffers, programs, vertex arrays.
    gl
        The module `OpenGL.GL`, for what moderngl lacks.
    kept
        What others keep as long as the context lives (programs, targets), by a key of theirs.
    talks
        Whether the driver tells of errors by itself; else it is asked.
    """

    moderngl: Any
    gl: ModuleType
    enter: Callable[[], None]
    leave: Callable[[], None]
    messages: list[str] = field(default_factory=list)
    kept: dict[Any, Any] = field(default_factory=dict)
    callback: Any = None
    talks: bool = True
    depth: int = 0

    @contextmanager
    def current(self) -> Iterator["Session"]:
        """Make the context current in this thread; one thread at a time. Errors that OpenGL met inside are raised."""
        with _lock:
            _not_in_a_child()
            if self is not _kept:
                raise GraphicsError("this OpenGL context was lost or closed: prepare the scene once more")
            if self.depth == 0:
                self.enter()
            self.depth += 1
            try:
                if self.depth == 1:
                    self.collect()
                yield self
                self.check()
            except self.failure as error:
                self.check()  # what OpenGL itself says of it
                raise GraphicsError(f"OpenGL error: {_one_line(error)}") from error
            finally:
                self.depth -= 1
                if self.depth == 0:
                    self.forget_errors()
                    self.leave()

    @property
    def failure(self) -> type[Exception]:
        """What moderngl raises."""
        import moderngl

        failure: type[Exception] = moderngl.Error
        return failure

    def collect(self) -> None:
        """Give back what was dropped in Python since, in whichever thread."""
        dropped = self.moderngl.objects
        while dropped:
            one = dropped.popleft()
            if hasattr(one, "release"):  # moderngl's own `gc` trips over what had been released by name
                one.release()

    def check(self) -> None:
        """Raise `GraphicsError` for errors that OpenGL has met since the last look."""
        global _kept
        if self.gl.glGetGraphicsResetStatus() != self.gl.GL_NO_ERROR:
            _kept = None  # the next caller makes a new one
            raise GraphicsError(
                "the OpenGL context was lost (the driver was reset): prepare the scene once more; " + WAY_OUT
            )
        text = self.messages[0] if self.messages else ""
        if not self.talks and (code := self.gl.glGetError()) != self.gl.GL_NO_ERROR:
            text = _ERRORS.get(code, hex(code))
        if text:
            self.forget_errors()
            if "OUT_OF_MEMORY" in text:
                raise GraphicsError(f"out of OpenGL memory: {_one_line(text)}; a smaller picture needs less, {WAY_OUT}")
            raise GraphicsError(f"OpenGL error: {_one_line(text)}")

    def forget_errors(self) -> None:
        """Let the next look begin anew."""
        self.messages.clear()
        for _ in range(len(_ERRORS)):  # a lost context would answer for ever
            if self.gl.glGetError() == self.gl.GL_NO_ERROR:
                break

    def integer(self, name: str) -> int:
        """A limit of the driver, such as `GL_MAX_TEXTURE_SIZE`."""
        return int(self.gl.glGetIntegerv(getattr(self.gl, name)))


def session() -> Session:
    """The context, made now if there is none.

    Raises
    ------
    GraphicsError
        Without OpenGL 4.5: says what is missing and how to get it. Also in a process forked from one that used OpenGL.
    """
    global _kept, _process
    with _lock:
        _not_in_a_child()
        if _kept is None:
            _kept = _make(os.environ.get("UMBRAE_GL", "egl"))
            _process = os.getpid()
        return _kept


def driver() -> str | None:
    """What the driver of the context calls itself; None as long as there is no context."""
    with _lock:
        if _kept is None or _process != os.getpid():
            return None
        with _kept.current() as current:
            return str(current.moderngl.info["GL_RENDERER"])


def close() -> None:
    """Give the context back with everything kept for it; the next call of `session` makes a new one."""
    global _kept
    with _lock:
        found, _kept = _kept, None
        if found is not None and _process == os.getpid():
            found.enter()
            found.kept.clear()
            found.collect()
            found.leave()
            found.moderngl.release()


def _not_in_a_child() -> None:
    if _process not in (None, os.getpid()):
        raise GraphicsError(
            "this process was forked from one that used OpenGL, and drivers do not survive that: start it by `spawn`, "
            f"or fork before OpenGL is used; {WAY_OUT}"
        )


def _make(way: str) -> Session:
    if way == "off":
        raise GraphicsError(f"OpenGL is switched off (UMBRAE_GL=off); {WAY_OUT}")
    if way not in ("egl", "glfw"):
        raise GraphicsError(f"UMBRAE_GL: wanted egl, glfw or off, got {way!r}; {WAY_OUT}")
    if way == "egl":
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    try:
        import moderngl
        import OpenGL
    except ImportError as error:
        raise GraphicsError(f"the Python package {error.name} is missing: {_INSTALL_PYTHON}; {WAY_OUT}") from error
    OpenGL.ERROR_CHECKING = False  # each call would ask; errors arrive as debug messages
    OpenGL.ERROR_ON_COPY = True
    try:
        made = _egl(moderngl) if way == "egl" else _glfw(moderngl)
    except GraphicsError:
        raise
    except Exception as error:  # whatever the loader, the driver and moderngl raise
        reason = "the driver has none" if _BAD_MATCH in str(error) else _one_line(error)
        raise GraphicsError(
            f"no OpenGL {MINIMUM // 100}.{MINIMUM % 100 // 10} context through {way}: {reason}; "
            f"software drivers: {_INSTALL_SYSTEM}; {WAY_OUT}"
        ) from error
    return made


def _egl(moderngl: ModuleType) -> Session:
    device = os.environ.get("UMBRAE_GL_DEVICE", "0")
    if not device.isdecimal():
        raise GraphicsError(f"UMBRAE_GL_DEVICE: wanted the number of a device, got {device!r}; {WAY_OUT}")
    library, opengl = _library("EGL"), _library("OpenGL", "GL")
    context = moderngl.create_context(
        standalone=True, backend="egl", require=MINIMUM, device_index=int(device), libegl=library, libgl=opengl
    )
    made = _session(
        context, enter=lambda: context.mglo.__enter__(), leave=lambda: context.mglo.__exit__(None, None, None)
    )
    # Its maker's thread lets go of it, so that any thread can take it. (PyOpenGL's EGL does not import when its error
    # checks are off.)
    egl = ctypes.CDLL(library)
    egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
    egl.eglMakeCurrent.argtypes = [ctypes.c_void_p] * 4
    egl.eglMakeCurrent(egl.eglGetCurrentDisplay(), None, None, None)
    return made


def _library(*names: str) -> str:
    """The first of these shared libraries that there is."""
    for name in names:
        found = ctypes.util.find_library(name)
        if found is not None:
            return found
    raise GraphicsError(f"lib{names[0]} is missing: {_INSTALL_SYSTEM}; {WAY_OUT}")


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _glfw(moderngl: ModuleType) -> Session:
    try:
        import glfw
    except ImportError as error:
        raise GraphicsError(f"UMBRAE_GL=glfw needs the Python package glfw: pip install glfw; {WAY_OUT}") from error
    if not glfw.init():
        raise GraphicsError(f"UMBRAE_GL=glfw: no window system to be found; UMBRAE_GL=egl needs none, {WAY_OUT}")
    for hint, value in (
        (glfw.VISIBLE, False),
        (glfw.CONTEXT_VERSION_MAJOR, MINIMUM // 100),
        (glfw.CONTEXT_VERSION_MINOR, MINIMUM % 100 // 10),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
    ):
        glfw.window_hint(hint, value)
    window = glfw.create_window(16, 16, "Umbrae", None, None)
    if not window:
        raise GraphicsError(f"UMBRAE_GL=glfw: the window system gives no OpenGL 4.5; {WAY_OUT}")
    glfw.make_context_current(window)
    made = _session(
        moderngl.create_context(require=MINIMUM),
        enter=lambda: glfw.make_context_current(window),
        leave=lambda: glfw.make_context_current(None),
    )
    made.leave()
    return made


def _session(context: Any, enter: Callable[[], None], leave: Callable[[], None]) -> Session:
    """Wrap a context that is current: from now on errors are heard, and dropped objects wait for `gc`."""
    from OpenGL import GL

    context.gc_mode = "context_gc"
    made = Session(context, GL, enter, leave)

    def heard(_source: int, kind: int, _id: int, _severity: int, length: int, text: Any, _user: Any) -> None:
        if kind == GL.GL_DEBUG_TYPE_ERROR:
            made.messages.append(ctypes.string_at(text, length).decode(errors="replace"))

    made.callback = GL.GLDEBUGPROC(heard)  # kept: OpenGL holds no reference of its own
    GL.glEnable(GL.GL_DEBUG_OUTPUT)
    GL.glEnable(GL.GL_DEBUG_OUTPUT_SYNCHRONOUS)
    GL.glDebugMessageCallback(made.callback, None)
    # Row 0 is the top row, as in all pictures; depth in [0, 1] keeps the digits of reversed depth.
    GL.glClipControl(GL.GL_UPPER_LEFT, GL.GL_ZERO_TO_ONE)
    GL.glEnable(0)  # no such capability: an error made on purpose
    made.talks = bool(made.messages)
    made.forget_errors()
    return made
