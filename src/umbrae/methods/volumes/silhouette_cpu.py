"""Silhouettes found on the CPU, their volumes drawn from a vertex buffer."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.predicates import facing
from umbrae.gl.program import program
from umbrae.methods.volumes.method import CONSTANTS, HERE, Frame, VolumeCaster, VolumeMethod
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_CHUNK = 1 << 14


@dataclass(frozen=True)
class SilhouetteCpu(VolumeMethod):
    """Shadow volumes of silhouettes that all CPU cores extract, edge by edge (after Brabec and Seidel 2003, van Waveren 2005).

    Multiplicities are those of Kim et al. 2008 with one decision for each triangle (Milet et al., section 2.2), which
    here is the exact predicate's: the volumes are closed on any soup.
    """

    name: ClassVar[str] = "silhouette-cpu"
    paper: ClassVar[str] = "Brabec, Seidel 2003; van Waveren 2005"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SilhouetteCpuCaster":
        return SilhouetteCpuCaster(scene, self, clock)


class SilhouetteCpuCaster(VolumeCaster):
    """The mesh with its edges; the silhouette of a light is extracted anew for every frame."""

    _ENTRY = np.dtype([("a", np.float32, 3), ("b", np.float32, 3), ("multiplicity", np.int32)])

    @property
    def cap_constants(self) -> dict[str, int | str]:
        return {**CONSTANTS, "DETERMINISM": 0, "FACING_FROM_BUFFER": 1}

    def extract(self, frame: Frame, clock: Clock) -> dict[str, int]:
        mesh, topology = self.mesh, self.mesh.edges
        side = np.empty(len(mesh.triangles), np.int32)
        multiplicity = np.empty(len(topology.vertices), np.int32)
        light = np.array(frame.uniforms["light"])

        def parts(count: int) -> list[tuple[int, int]]:
            return [(start, min(start + _CHUNK, count)) for start in range(0, count, _CHUNK)]

        triangles, edges = parts(len(side)), parts(len(multiplicity))
        run(lambda i: _face(mesh.positions, mesh.triangles, light, *triangles[i], side), len(triangles))
        run(
            lambda i: _sum(topology.offsets, topology.triangle, mesh.sign, side, *edges[i], multiplicity), len(edges)
        )
        found = np.flatnonzero(multiplicity)
        m = multiplicity[found]
        if frame.stencil:  # counts by ones
            found, m = np.repeat(found, np.abs(m)), np.repeat(np.sign(m), np.abs(m))
        entries = np.empty(len(found), self._ENTRY)
        entries["a"], entries["b"] = (mesh.positions[topology.vertices[found, end]] for end in range(2))
        entries["multiplicity"] = m
        self._entries, self._count_entries = self.buffer(entries), len(entries)
        self._side = self.buffer(side)
        return {"silhouette_edges": int(np.count_nonzero(multiplicity))}

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        drawn = program(self.session, HERE / "quads.glsl", frame.constants)
        self.prepare_program(drawn, frame)
        if self._count_entries:
            content: list[Any] = [(self._entries, "3f 3f 1i/i", "a", "b", "multiplicity")]
            array = self.session.moderngl.vertex_array(drawn, content)
            array.render(self.session.moderngl.TRIANGLE_STRIP, vertices=4, instances=self._count_entries)
        self._side.bind_to_storage_buffer(1)


@kernel
def _face(positions, triangles, light, start, stop, side):
    for t in range(start, stop):
        side[t] = facing(positions, triangles, t, light)


@kernel
def _sum(offsets, triangle, sign, side, start, stop, multiplicity):
    for edge in range(start, stop):
        total = 0
        for entry in range(offsets[edge], offsets[edge + 1]):
            total += sign[entry] * side[triangle[entry]]
        multiplicity[edge] = total
