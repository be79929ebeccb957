"""Silhouettes found on the CPU, their volumes drawn from a vertex buffer."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.program import program
from umbrae.methods.volumes.caster import SilhouetteCaster
from umbrae.methods.volumes.engine import HERE, Frame
from umbrae.methods.volumes.method import SilhouetteMethod
from umbrae.parallel import inline, kernel, run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_CHUNK = 1 << 14


@dataclass(frozen=True)
class SilhouetteCpu(SilhouetteMethod):
    """Shadow volumes of silhouettes that all CPU cores extract (after Brabec and Seidel 2003, van Waveren 2005).

    Multiplicities are those of Kim et al. 2008 with one decision for each triangle (Milet et al., section 2.2), which
    here is the exact predicate's: the volumes are closed on any soup. The weaker kinds of `determinism` compute in
    float32, as on a GPU.
    """

    name: ClassVar[str] = "silhouette-cpu"
    paper: ClassVar[str] = "Brabec, Seidel 2003; van Waveren 2005"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SilhouetteCpuCaster":
        return SilhouetteCpuCaster(scene, self, clock)


class SilhouetteCpuCaster(SilhouetteCaster):
    """The mesh with its edges; the silhouette of a light is extracted anew for every frame."""

    _ENTRY = np.dtype([("a", np.float32, 3), ("b", np.float32, 3), ("multiplicity", np.int32)])

    @property
    def cap_constants(self) -> dict[str, int | str]:
        return {**super().cap_constants, "FACING_FROM_BUFFER": 1}

    def extract(self, frame: Frame, clock: Clock) -> dict[str, int]:
        mesh, topology = self.mesh, self.mesh.edges
        light = np.array(frame.uniforms["light"], np.float32)
        multiplicity = np.empty(len(topology.vertices), np.int32)
        chunks = [(start, min(start + _CHUNK, len(multiplicity))) for start in range(0, len(multiplicity), _CHUNK)]
        kept = np.arange(len(mesh.triangles)) if self.kept is None else np.flatnonzero(self.kept)
        triangles, sides = mesh.triangles[kept], np.zeros(len(mesh.triangles), np.int8)
        if self.method.determinism == "reference-edge":
            facing = facing_of_all(mesh.positions, triangles, light)
        else:
            facing = np.empty(len(kept), np.int8)
            _face_by_edges(mesh.positions, triangles, light, self.method.determinism == "three-edge", facing)
        sides[kept] = facing
        self._side = sides.astype(np.int32)
        if self.method.determinism == "none":
            soup = mesh.positions, topology.vertices, topology.offsets, mesh.opposite_of(self.kept)
            run(lambda i: _sum_by_edge(*soup, light, *chunks[i], multiplicity), len(chunks))
        else:
            arrays = topology.offsets, topology.triangle, mesh.sign, sides
            run(lambda i: _sum(*arrays, *chunks[i], multiplicity), len(chunks))
        found = np.flatnonzero(multiplicity)
        m = multiplicity[found]
        if frame.stencil:  # counts by ones
            found, m = np.repeat(found, np.abs(m)), np.repeat(np.sign(m), np.abs(m))
        entries = np.empty(len(found), self._ENTRY)
        entries["a"], entries["b"] = (mesh.positions[topology.vertices[found, end]] for end in range(2))
        entries["multiplicity"] = m
        self._entries, self._entry_count = self.buffer(entries), len(entries)
        return {"silhouette_edges": int(np.count_nonzero(multiplicity))}

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        drawn = program(self.session, HERE / "quads.glsl", frame.constants)
        self.prepare_program(drawn, frame)
        if self._entry_count:
            content: list[Any] = [(self._entries, "3f 3f 1i/i", "a", "b", "multiplicity")]
            array = self.session.moderngl.vertex_array(drawn, content)
            array.render(self.session.moderngl.TRIANGLE_STRIP, vertices=4, instances=self._entry_count)

    def bind_sides(self, capped: NDArray[np.int32]) -> None:
        self.buffer(self._side[capped]).bind_to_storage_buffer(1)


@kernel
def _sum(offsets, triangle, sign, side, start, stop, multiplicity):
    for edge in range(start, stop):
        total = 0
        for entry in range(offsets[edge], offsets[edge + 1]):
            total += sign[entry] * side[triangle[entry]]
        multiplicity[edge] = total


@kernel
def _face_by_edges(positions, triangles, light, strict, side):
    """Each triangle's side as its first edge has it, in float32; 0 where `strict` and the other two disagree."""
    for t in range(len(triangles)):
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        side[t] = _opposite_side(positions, light, p, q, r)
        if strict:
            second, third = _opposite_side(positions, light, q, r, p), -_opposite_side(positions, light, p, r, q)
            if side[t] != second or side[t] != third:
                side[t] = 0


@kernel
def _sum_by_edge(positions, vertices, offsets, opposite, light, start, stop, multiplicity):
    """The same with a side for each edge of a triangle by itself."""
    for edge in range(start, stop):
        a, b = vertices[edge, 0], vertices[edge, 1]
        total = 0
        for entry in range(offsets[edge], offsets[edge + 1]):
            total += _opposite_side(positions, light, a, b, opposite[entry])
        multiplicity[edge] = total


@inline
def _opposite_side(positions, light, a, b, o):
    """The side of the plane through the light and the edge from a to b that vertex o lies on, in float32."""
    w = light[3]
    ax, ay, az = positions[a, 0], positions[a, 1], positions[a, 2]
    tx, ty, tz = light[0] - w * ax, light[1] - w * ay, light[2] - w * az
    ex, ey, ez = positions[b, 0] - ax, positions[b, 1] - ay, positions[b, 2] - az
    dx, dy, dz = positions[o, 0] - ax, positions[o, 1] - ay, positions[o, 2] - az
    value = (ty * ez - tz * ey) * dx + (tz * ex - tx * ez) * dy + (tx * ey - ty * ex) * dz
    return 1 if value > 0 else (-1 if value < 0 else 0)
