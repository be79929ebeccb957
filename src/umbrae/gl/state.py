"""State beyond what moderngl sets: depth, stencil, blending. Set whole before each pass."""

from umbrae.gl.context import Session
from umbrae.gl.targets import CountTarget, DepthTarget, IdTarget


def see_nearest(session: Session, target: IdTarget) -> None:
    """Fragments nearer than what is there replace it; what lies before the near plane is clipped."""
    gl = session.gl
    _use(session, target)
    gl.glDisable(gl.GL_DEPTH_CLAMP)
    gl.glDepthMask(True)
    gl.glPolygonMode(gl.GL_FRONT_AND_BACK, gl.GL_FILL)
    gl.glDepthFunc(gl.GL_GREATER)
    gl.glColorMask(True, True, True, True)


def write_depth(session: Session, target: CountTarget) -> None:
    """Fragments replace the depth, whatever it is; nothing else is written."""
    gl = session.gl
    _use(session, target)
    gl.glDepthMask(True)
    gl.glPolygonMode(gl.GL_FRONT_AND_BACK, gl.GL_FILL)
    gl.glDepthFunc(gl.GL_ALWAYS)
    gl.glColorMask(False, False, False, False)


def cast_depth(session: Session, target: DepthTarget, slope: float) -> None:
    """The nearest depth stays, pushed back by `slope` pixels of the steeper of its two slopes."""
    gl = session.gl
    _use(session, target)
    gl.glDepthMask(True)
    gl.glPolygonMode(gl.GL_FRONT_AND_BACK, gl.GL_FILL)
    gl.glDepthFunc(gl.GL_GREATER)
    gl.glEnable(gl.GL_POLYGON_OFFSET_FILL)
    gl.glPolygonOffset(-slope, 0.0)


def test_depth(session: Session, target: CountTarget) -> None:
    """Fragments strictly nearer than the stored depth pass; nothing is written."""
    gl = session.gl
    _use(session, target)
    gl.glDepthMask(False)
    gl.glPolygonMode(gl.GL_FRONT_AND_BACK, gl.GL_FILL)
    gl.glDepthFunc(gl.GL_GREATER)
    gl.glColorMask(False, False, False, False)


def count_faces(
    session: Session, target: CountTarget, behind: bool, depth_test: bool = True, outlines: bool = False
) -> None:
    """Fragments add to the counter and leave the depth alone.

    `behind` counts those at or beyond the stored depth (z-fail) instead of those strictly nearer (z-pass); without
    `depth_test` all count. With a stencil, a front face adds 1 in front of the depth and takes 1 off behind it.
    `outlines` draws the faces' edges alone, to be looked at.
    """
    gl = session.gl
    _use(session, target)
    gl.glDepthMask(False)
    gl.glPolygonMode(gl.GL_FRONT_AND_BACK, gl.GL_LINE if outlines else gl.GL_FILL)
    gl.glDepthFunc((gl.GL_LEQUAL if behind else gl.GL_GREATER) if depth_test else gl.GL_ALWAYS)
    if target.stencil:
        gl.glColorMask(False, False, False, False)
        gl.glEnable(gl.GL_STENCIL_TEST)
        gl.glStencilMask(0xFF)
        gl.glStencilFunc(gl.GL_ALWAYS, 0, 0xFF)
        front, back = gl.GL_INCR_WRAP, gl.GL_DECR_WRAP
        gl.glStencilOpSeparate(gl.GL_FRONT, gl.GL_KEEP, gl.GL_KEEP, back if behind else front)
        gl.glStencilOpSeparate(gl.GL_BACK, gl.GL_KEEP, gl.GL_KEEP, front if behind else back)
    else:
        gl.glColorMask(True, True, True, True)
        gl.glEnable(gl.GL_BLEND)
        gl.glBlendEquation(gl.GL_FUNC_ADD)
        gl.glBlendFunc(gl.GL_ONE, gl.GL_ONE)


def push_back(session: Session, subpixel_bits: int) -> None:
    """Draw faces, until the next pass, as far behind their place as vertex snapping may have brought them before it.

    A vertex is moved by at most half a step of the subpixel grid in x and in y, so depth by a step's share of the
    steeper of the two slopes. (Units of depth would be as large as those of the face's nearest point.)
    """
    gl = session.gl
    gl.glEnable(gl.GL_POLYGON_OFFSET_FILL)
    gl.glPolygonOffset(-(2.0**-subpixel_bits), 0.0)


def _use(session: Session, target: CountTarget | DepthTarget | IdTarget) -> None:
    gl = session.gl
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target.framebuffer)
    gl.glViewport(0, 0, target.width, target.height)
    for capability in (
        gl.GL_CULL_FACE,
        gl.GL_SCISSOR_TEST,
        gl.GL_STENCIL_TEST,
        gl.GL_BLEND,
        gl.GL_RASTERIZER_DISCARD,
        gl.GL_POLYGON_OFFSET_FILL,
    ):
        gl.glDisable(capability)
    gl.glEnable(gl.GL_DEPTH_TEST)
    # Not even an infinite far plane stops clipping at the near one: faces nearer than that count as well.
    gl.glEnable(gl.GL_DEPTH_CLAMP)
