"""Silhouettes by multiplicity, in a compute shader."""

import struct
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.errors import GraphicsError
from umbrae.gl.compute import clear
from umbrae.gl.program import apply, program
from umbrae.methods.volumes.caster import SilhouetteCaster
from umbrae.methods.volumes.engine import HERE, Frame
from umbrae.methods.volumes.method import SilhouetteMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_GROUP = 64
_ROW = 65535
"""Groups side by side that every driver takes."""
_ENTRY_BYTES = 28


@dataclass(frozen=True)
class SilhouetteCompute(SilhouetteMethod):
    """Shadow volumes of silhouettes on any soup, listed by a compute shader and drawn indirectly.

    Multiplicities as in Milet et al., section 2.2; no number of them passes through the CPU.
    """

    name: ClassVar[str] = "silhouette-compute"
    paper: ClassVar[str] = "Milet et al.; Peciva et al. 2013"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SilhouetteComputeCaster":
        return SilhouetteComputeCaster(scene, self, clock)


class SilhouetteComputeCaster(SilhouetteCaster):
    """Edges and what is adjacent to them as the shaders read them, and room for all sides there may be."""

    @property
    def cap_constants(self) -> dict[str, int | str]:
        return {**super().cap_constants, "FACING_FROM_BUFFER": 1}

    def upload(self, clock: Clock) -> None:
        mesh, topology = self.mesh, self.mesh.edges
        context = self.session.moderngl
        self._edge_count = len(topology.vertices)
        self._edges = self.buffer(topology.vertices)
        self._offsets = self.buffer(topology.offsets.astype(np.int32))
        self._adjacent = self.buffer((topology.triangle + 1) * mesh.sign.astype(np.int32))
        self._sides = context.buffer(reserve=4 * len(mesh.triangles))
        # A side for every edge; a counter that counts by ones may take one for every adjacency.
        room = len(mesh.opposite) if self.stencil else self._edge_count
        most = self.session.integer("GL_MAX_SHADER_STORAGE_BLOCK_SIZE")
        if room * _ENTRY_BYTES > most:
            raise GraphicsError(
                f"silhouette-compute: {room} edges need {room * _ENTRY_BYTES} bytes in one buffer, this OpenGL driver "
                f"takes {most}; `silhouette-cpu` needs no such buffer"
            )
        self._entries: Any = context.buffer(reserve=room * _ENTRY_BYTES)
        self._command: Any = context.buffer(reserve=16)

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        looked_at = np.arange(len(self.mesh.triangles)) if kept is None else np.flatnonzero(kept)
        self._kept, self._kept_count = self.buffer(looked_at.astype(np.int32)), len(looked_at)
        clear(self.session, self._sides)  # of the others
        if self.method.determinism == "none":
            self._adjacent = self.buffer(self.mesh.opposite_of(kept))

    def extract(self, frame: Frame, clock: Clock) -> dict[str, int]:
        self._command.write(struct.pack("4I", 4, 0, 0, 0))
        inputs = [self.vertices, self.triangle_index, self._sides, self._kept]
        self._dispatch({"SIDES_OF_TRIANGLES": 1}, frame, self._kept_count, inputs)
        inputs = [self.vertices, self._edges, self._sides, self._offsets, self._adjacent, self._entries, self._command]
        self._dispatch({} if frame.stencil else {"FLOAT_COUNTER": 1}, frame, self._edge_count, inputs)
        return {}

    def _dispatch(self, constants: dict[str, int | str], frame: Frame, count: int, buffers: list[Any]) -> None:
        """Run one of the two passes, and let the next one see what it wrote."""
        path = HERE / "silhouette_compute.glsl"
        shader = program(self.session, path, {**self.multiplicity_constants, **constants})
        apply(shader, frame.uniforms)
        shader["count"].value = count
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        groups = -(-count // _GROUP)
        shader.run(min(groups, _ROW), -(-groups // _ROW))
        self.session.moderngl.memory_barrier()

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        drawn = program(self.session, HERE / "quads.glsl", frame.constants)
        self.prepare_program(drawn, frame)
        context = self.session.moderngl
        array = context.vertex_array(drawn, [(self._entries, "3f 3f 1i/i", "a", "b", "multiplicity")])
        array.render_indirect(self._command, context.TRIANGLE_STRIP, 1)

    def bind_sides(self, capped: NDArray[np.int32]) -> None:
        sides = self._sides
        if len(capped) < len(self.mesh.triangles):
            sides = self.buffer(np.frombuffer(sides.read(), np.int32)[capped])
        sides.bind_to_storage_buffer(1)
