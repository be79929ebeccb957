"""Robust shadow volumes for low-quality meshes, in a geometry shader."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.edges import edges
from umbrae.geometry.solids import find_solids
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.light import Light
from umbrae.methods.volumes.caster import VolumeCaster
from umbrae.methods.volumes.engine import Frame
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True)
class RobustGs(VolumeMethod):
    """Shadow volumes of meshes that are open or cross themselves (Stich, Waechter, Keller 2007, section 11.3.1).

    Each triangle comes with its neighbours. Those that face the light extrude the edges where a neighbour is missing
    or faces away; those that face away do the same, inverted. Preprocessing finds parts for which the first half is
    enough, and disconnects what has no single neighbour: edges of more than two triangles, or of two with opposite
    windings.

    Deviations from the paper: the cheaper way is taken for parts whose winding number is provably nowhere negative (see
    `geometry.solids`) and whose box does not hold the light, since a two-manifold that crosses itself can have a lobe
    that is inside out, and one around the light faces it from within. Elsewhere an edge between two triangles that face
    different ways is extruded once and counts twice, as the paper wished for. A side of two triangles is found by the
    triangles' corners in order, one predicate and no three normals, wherever it is looked at. Listing 11-1 in float32
    has no bound; here an unsure side is decided in float64.
    """

    name: ClassVar[str] = "robust-gs"
    paper: ClassVar[str] = "Stich, Waechter, Keller 2007"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "RobustGsCaster":
        return RobustGsCaster(scene, self, clock)


class RobustGsCaster(VolumeCaster):
    """Triangles with their neighbours, and the solids among them."""

    def upload(self, clock: Clock) -> None:
        self._rows, self._beside = adjacency(self.mesh.winding)

    def upload_places(self, clock: Clock) -> None:
        with clock.span("solids"):
            everything = np.ones(len(self.scene.triangles), bool)
            self._solids = find_solids(self.scene.positions, self.scene.triangles, everything)
        self._solid = self._solids.of[self.mesh.source]

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        rows = self._rows
        if kept is not None:
            rows = rows[kept]
            lost = (self._beside[kept] >= 0) & ~kept[self._beside[kept]]
            rows[:, 1::2] = np.where(lost, rows[:, ::2], rows[:, 1::2])
        self._adjacency = self.buffer(rows)

    def casting(self, light: Light) -> NDArray[np.bool_] | None:
        cheap = self._cheap(light)
        if not cheap.any():
            return None
        facing = facing_of_all(self.scene.positions, self.scene.triangles, light.position)[self.mesh.source]
        return ~cheap | (facing > 0)

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        cheap = self._cheap(frame.light).astype(np.int32)
        self.buffer(cheap if self.kept is None else cheap[self.kept]).bind_to_storage_buffer(1)
        self.draw("robust_gs.glsl", frame, self._adjacency, "TRIANGLES_ADJACENCY")

    def _cheap(self, light: Light) -> NDArray[np.bool_]:
        """`(t,)` the triangles of solids that do not hold the light in their box."""
        x = light.position[:3].astype(np.float64)
        holds: NDArray[np.bool_] = np.all((self._solids.lower <= x) & (x <= self._solids.upper), axis=1)
        # The last entry is for triangles of no solid, whose number is -1.
        free = np.append(~holds | light.is_directional, False)
        cheap: NDArray[np.bool_] = free[self._solid]
        return cheap


def adjacency(winding: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """`(t, 6)` corner and neighbour in turn, from welded `winding (t, 3)`; no neighbour is the corner before once more.

    Also `(t, 3)` the triangles that these neighbours belong to, -1 for none.

    The neighbour behind an edge is the opposite vertex of the one other triangle that meets there, if there is just one
    and it runs along the edge in the other direction.
    """
    made, beside = np.repeat(winding, 2, axis=1), np.full(winding.shape, -1, np.int32)
    topology = edges(winding)
    paired = np.flatnonzero((topology.count == 2) & (topology.balance == 0))
    first = topology.offsets[paired]
    for own, other in ((first, first + 1), (first + 1, first)):
        triangle, beyond = topology.triangle[own], topology.triangle[other]
        low, high = topology.vertices[paired].T
        start = np.where(topology.sign[own] > 0, low, high)
        slot = np.argmax(winding[triangle] == start[:, None], axis=1)
        opposite = winding[beyond].sum(axis=1, dtype=np.int64) - low - high
        made[triangle, 2 * slot + 1] = opposite
        beside[triangle, slot] = beyond
    return made, beside
