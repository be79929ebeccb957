"""What OpenGL says about its work: how long a stage takes, how many samples passed the depth test."""

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


@contextmanager
def samples_passed(session: Session) -> Iterator[list[int]]:
    """A list that holds, afterwards, how many samples passed the depth test meanwhile: updates of a counter."""
    gl = session.gl
    query, found = np.zeros(1, np.uint32), list[int]()
    gl.glGenQueries(1, query)
    try:
        try:
            gl.glBeginQuery(gl.GL_SAMPLES_PASSED, query[0])
            yield found
        finally:
            gl.glEndQuery(gl.GL_SAMPLES_PASSED)
        passed = gl.GLuint64(0)
        gl.glGetQueryObjectui64v(int(query[0]), gl.GL_QUERY_RESULT, passed)
        found.append(int(passed.value))
    finally:
        gl.glDeleteQueries(1, query)
