"""Silhouettes by multiplicity, in a compute shader."""

import struct
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from umbrae.clock import Clock
from umbrae.gl.program import apply, program
from umbrae.methods.volumes.caster import HERE, Frame, SilhouetteCaster
from umbrae.methods.volumes.method import SilhouetteMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_GROUP = 64
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
    """Edges and their opposite vertices as the shader reads them, and room for all sides there may be."""

    def upload(self, clock: Clock) -> None:
        topology = self.mesh.edges
        self._edge_count = len(topology.vertices)
        self._inputs = [
            self.vertices,
            self.buffer(topology.vertices),
            self.buffer(topology.offsets.astype(np.int32)),
            self.buffer(self.mesh.opposite),
        ]
        # A side for every edge; a counter that counts by ones may take one for every adjacency.
        room = len(self.mesh.opposite) if self.stencil else self._edge_count
        self._entries: Any = self.session.moderngl.buffer(reserve=max(1, room) * _ENTRY_BYTES)
        self._command: Any = self.session.moderngl.buffer(reserve=16)

    def extract(self, frame: Frame, clock: Clock) -> dict[str, int]:
        shader = program(
            self.session,
            HERE / "silhouette_compute.glsl",
            {**self.multiplicity_constants, **({} if frame.stencil else {"FLOAT_COUNTER": 1})},
        )
        apply(shader, frame.uniforms)
        shader["edge_count"].value = self._edge_count
        self._command.write(struct.pack("4I", 4, 0, 0, 0))
        for binding, buffer in enumerate([*self._inputs, self._entries, self._command]):
            buffer.bind_to_storage_buffer(binding)
        shader.run(-(-self._edge_count // _GROUP))
        self.session.moderngl.memory_barrier()
        return {}

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        drawn = program(self.session, HERE / "quads.glsl", frame.constants)
        self.prepare_program(drawn, frame)
        context = self.session.moderngl
        array = context.vertex_array(drawn, [(self._entries, "3f 3f 1i/i", "a", "b", "multiplicity")])
        array.render_indirect(self._command, context.TRIANGLE_STRIP, 1)
