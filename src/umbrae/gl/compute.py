"""Compute shaders: one call per pass."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from umbrae.gl.context import Session
from umbrae.gl.program import program

GROUP = 64
"""Invocations in a group, for shaders that have no reason for another number."""
_ROW = 65535
"""Groups side by side that every driver takes."""
_ARGUMENTS, _ARGUMENT_BYTES = "arguments of an indirect dispatch", 12


def groups_of(count: int) -> int:
    """How many groups have at least `count` invocations."""
    return -(-count // GROUP)


def dispatch(
    session: Session,
    path: Path,
    groups: int | tuple[Any, int],
    uniforms: Mapping[str, Any],
    buffers: Mapping[int, Any],
    defines: Mapping[str, int | str] | None = None,
) -> None:
    """Run a compute shader, and let others see its work.

    `groups`: how many (they are laid out in rows: see `invocation.glsl`), or a buffer and the place in it where three
    numbers say that. `uniforms` by name: those are set that it uses, lists as far as it uses them. `buffers` by
    binding.
    """
    shader = program(session, path, defines)
    for name, value in uniforms.items():
        if name in shader:
            uniform = shader[name]
            if isinstance(value, list):
                value = value[: uniform.array_length] if uniform.array_length > 1 else value[0]
            uniform.value = value
    for binding, buffer in buffers.items():
        buffer.bind_to_storage_buffer(binding)
    if isinstance(groups, int):
        shader.run(min(groups, _ROW), -(-groups // _ROW))
    else:
        # In a buffer of their own: where a shader also writes to the one that holds them, NVIDIA's driver loses what
        # it writes.
        if _ARGUMENTS not in session.kept:
            session.kept[_ARGUMENTS] = session.moderngl.buffer(reserve=_ARGUMENT_BYTES)
        own = session.kept[_ARGUMENTS]
        session.moderngl.copy_buffer(own, groups[0], _ARGUMENT_BYTES, read_offset=groups[1])
        shader.run_indirect(own)
    session.moderngl.memory_barrier()


def clear(session: Session, buffer: Any) -> None:
    """Fill a buffer with zeros, on the GPU."""
    gl = session.gl
    gl.glClearNamedBufferData(buffer.glo, gl.GL_R32UI, gl.GL_RED_INTEGER, gl.GL_UNSIGNED_INT, None)
