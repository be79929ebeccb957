"""How long a stage takes: on the GPU by a timer query, and on the wall with a finish at its end."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from umbrae.clock import Clock
from umbrae.gl.context import Session


@contextmanager
def stage(session: Session, clock: Clock, name: str) -> Iterator[None]:
    """A span on the clock that lasts until OpenGL has finished, and one named "gpu ..." with what the query says."""
    gl = session.gl
    query = np.zeros(1, np.uint32)
    gl.glGenQueries(1, query)
    try:
        with clock.span(name):
            try:
                gl.glBeginQuery(gl.GL_TIME_ELAPSED, query[0])
                yield
            finally:
                gl.glEndQuery(gl.GL_TIME_ELAPSED)
                gl.glFinish()
        nanoseconds = gl.GLuint64(0)
        gl.glGetQueryObjectui64v(int(query[0]), gl.GL_QUERY_RESULT, nanoseconds)
        clock.record(f"gpu {name}", nanoseconds.value * 1e-9)
    finally:
        gl.glDeleteQueries(1, query)
