"""What is drawn into: depth beside a counter, beside the number of a triangle, or alone."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import GraphicsError
from umbrae.gl.context import WAY_OUT, Session

BYTES_PER_PIXEL = 16
"""At most: depth (32 bits, 64 with stencil), a counter, and what is uploaded."""


@dataclass(eq=False)
class CountTarget:
    """A depth buffer (32-bit float) with a counter of 32-bit float, or with an 8-bit stencil."""

    session: Session
    width: int
    height: int
    stencil: bool
    framebuffer: int
    depth: int
    counter: int

    def clear(self, count: int) -> None:
        """Nothing nearer than infinity; the counter at `count`."""
        gl = self.session.gl
        gl.glDepthMask(True)
        gl.glColorMask(True, True, True, True)
        if self.stencil:
            gl.glStencilMask(0xFF)
            gl.glClearNamedFramebufferfi(self.framebuffer, gl.GL_DEPTH_STENCIL, 0, 0.0, count)
        else:
            gl.glClearNamedFramebufferfv(self.framebuffer, gl.GL_DEPTH, 0, np.zeros(1, np.float32))
            gl.glClearNamedFramebufferfv(self.framebuffer, gl.GL_COLOR, 0, np.full(4, count, np.float32))

    def read(self) -> NDArray[np.int32]:
        """The counter, `(height, width)`."""
        gl = self.session.gl
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, self.framebuffer)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
        kind = np.uint8 if self.stencil else np.float32
        found = np.empty((self.height, self.width), kind)
        if self.stencil:
            gl.glReadPixels(0, 0, self.width, self.height, gl.GL_STENCIL_INDEX, gl.GL_UNSIGNED_BYTE, found)
        else:
            gl.glReadPixels(0, 0, self.width, self.height, gl.GL_RED, gl.GL_FLOAT, found)
        return found.astype(np.int32)

    @property
    def counter_bytes(self) -> int:
        """What the counter takes beside the depth; drivers may pad a stencil."""
        return self.width * self.height * (1 if self.stencil else 4)

    def delete(self) -> None:
        """Give its memory back."""
        gl = self.session.gl
        gl.glDeleteFramebuffers(1, np.array([self.framebuffer], np.uint32))
        gl.glDeleteTextures(2, np.array([self.depth, self.counter], np.uint32))  # 0 is ignored


def count_target(session: Session, width: int, height: int, stencil: bool) -> CountTarget:
    """The target of that size and kind; the last one is kept for the next call.

    Raises
    ------
    GraphicsError
        For a picture larger than the driver's largest texture.
    """
    kept: CountTarget | None = session.kept.get("count target")
    if kept is not None and (kept.width, kept.height, kept.stencil) == (width, height, stencil):
        return kept
    _check_size(session, width, height)
    if kept is not None:
        session.kept.pop("count target").delete()
    made = session.kept["count target"] = _count_target(session, width, height, stencil)
    return made


@dataclass(eq=False)
class IdTarget:
    """A depth buffer (32-bit float) with the numbers of the primitives that are nearest."""

    session: Session
    width: int
    height: int
    framebuffer: int
    depth: int
    ids: int

    def clear(self) -> None:
        """Nothing nearer than infinity, -1 everywhere."""
        gl = self.session.gl
        gl.glDepthMask(True)
        gl.glColorMask(True, True, True, True)
        gl.glClearNamedFramebufferfv(self.framebuffer, gl.GL_DEPTH, 0, np.zeros(1, np.float32))
        gl.glClearNamedFramebufferiv(self.framebuffer, gl.GL_COLOR, 0, np.full(4, -1, np.int32))

    def read(self) -> NDArray[np.int32]:
        """The numbers, `(height, width)`."""
        gl = self.session.gl
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, self.framebuffer)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
        found = np.empty((self.height, self.width), np.int32)
        gl.glReadPixels(0, 0, self.width, self.height, gl.GL_RED_INTEGER, gl.GL_INT, found)
        return found

    def delete(self) -> None:
        """Give its memory back."""
        gl = self.session.gl
        gl.glDeleteFramebuffers(1, np.array([self.framebuffer], np.uint32))
        gl.glDeleteTextures(2, np.array([self.depth, self.ids], np.uint32))


def id_target(session: Session, width: int, height: int) -> IdTarget:
    """The target of that size; the last one is kept for the next call.

    Raises
    ------
    GraphicsError
        For a picture larger than the driver's largest texture.
    """
    kept: IdTarget | None = session.kept.get("id target")
    if kept is not None and (kept.width, kept.height) == (width, height):
        return kept
    _check_size(session, width, height)
    if kept is not None:
        session.kept.pop("id target").delete()
    gl = session.gl
    framebuffer, depth, ids = _one(gl.glCreateFramebuffers), _texture(gl), _texture(gl)
    gl.glTextureStorage2D(depth, 1, gl.GL_DEPTH_COMPONENT32F, width, height)
    gl.glTextureStorage2D(ids, 1, gl.GL_R32I, width, height)
    gl.glNamedFramebufferTexture(framebuffer, gl.GL_DEPTH_ATTACHMENT, depth, 0)
    gl.glNamedFramebufferTexture(framebuffer, gl.GL_COLOR_ATTACHMENT0, ids, 0)
    _check_complete(session, framebuffer, width, height)
    made = session.kept["id target"] = IdTarget(session, width, height, framebuffer, depth, ids)
    return made


@dataclass(eq=False)
class DepthTarget:
    """A square depth buffer (32-bit float) by itself, which shaders may look things up in."""

    session: Session
    size: int
    framebuffer: int
    depth: int

    @property
    def width(self) -> int:
        """Pixels in a row."""
        return self.size

    @property
    def height(self) -> int:
        """Rows."""
        return self.size

    def clear(self) -> None:
        """Nothing nearer than infinity."""
        gl = self.session.gl
        gl.glDepthMask(True)
        gl.glClearNamedFramebufferfv(self.framebuffer, gl.GL_DEPTH, 0, np.zeros(1, np.float32))

    def delete(self) -> None:
        """Give its memory back."""
        gl = self.session.gl
        gl.glDeleteFramebuffers(1, np.array([self.framebuffer], np.uint32))
        gl.glDeleteTextures(1, np.array([self.depth], np.uint32))


def depth_target(session: Session, size: int) -> DepthTarget:
    """The target of that size; the last one is kept for the next call.

    Raises
    ------
    GraphicsError
        For one larger than the driver's largest texture.
    """
    kept: DepthTarget | None = session.kept.get("depth target")
    if kept is not None and kept.size == size:
        return kept
    _check_size(session, size, size)
    if kept is not None:
        session.kept.pop("depth target").delete()
    gl = session.gl
    framebuffer, depth = _one(gl.glCreateFramebuffers), _texture(gl)
    gl.glTextureStorage2D(depth, 1, gl.GL_DEPTH_COMPONENT32F, size, size)
    gl.glNamedFramebufferTexture(framebuffer, gl.GL_DEPTH_ATTACHMENT, depth, 0)
    gl.glNamedFramebufferDrawBuffer(framebuffer, gl.GL_NONE)
    _check_complete(session, framebuffer, size, size)
    made = session.kept["depth target"] = DepthTarget(session, size, framebuffer, depth)
    return made


def _check_size(session: Session, width: int, height: int) -> None:
    largest = session.integer("GL_MAX_TEXTURE_SIZE")
    if max(width, height) > largest:
        raise GraphicsError(
            f"a picture of {width} x {height} pixels is too large for this OpenGL driver, which takes up to "
            f"{largest} a side; {WAY_OUT}"
        )


def _check_complete(session: Session, framebuffer: int, width: int, height: int) -> None:
    gl = session.gl
    session.check()
    if gl.glCheckNamedFramebufferStatus(framebuffer, gl.GL_FRAMEBUFFER) != gl.GL_FRAMEBUFFER_COMPLETE:
        raise GraphicsError(f"this OpenGL driver cannot draw into a picture of {width} x {height} pixels; {WAY_OUT}")


def _count_target(session: Session, width: int, height: int, stencil: bool) -> CountTarget:
    gl = session.gl
    framebuffer = _one(gl.glCreateFramebuffers)
    depth, counter = _texture(gl), 0
    gl.glTextureStorage2D(depth, 1, gl.GL_DEPTH32F_STENCIL8 if stencil else gl.GL_DEPTH_COMPONENT32F, width, height)
    attachment = gl.GL_DEPTH_STENCIL_ATTACHMENT if stencil else gl.GL_DEPTH_ATTACHMENT
    gl.glNamedFramebufferTexture(framebuffer, attachment, depth, 0)
    if not stencil:
        counter = _texture(gl)
        gl.glTextureStorage2D(counter, 1, gl.GL_R32F, width, height)
        gl.glNamedFramebufferTexture(framebuffer, gl.GL_COLOR_ATTACHMENT0, counter, 0)
    _check_complete(session, framebuffer, width, height)
    return CountTarget(session, width, height, stencil, framebuffer, depth, counter)


def _one(create: Any) -> int:
    name = np.zeros(1, np.uint32)
    create(1, name)
    return int(name[0])


def _texture(gl: Any) -> int:
    name = np.zeros(1, np.uint32)
    gl.glCreateTextures(gl.GL_TEXTURE_2D, 1, name)
    return int(name[0])
