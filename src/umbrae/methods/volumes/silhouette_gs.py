"""Silhouettes by multiplicity, in a geometry shader."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from umbrae.clock import Clock
from umbrae.methods.volumes.caster import SilhouetteCaster
from umbrae.methods.volumes.engine import Frame
from umbrae.methods.volumes.method import SilhouetteMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True)
class SilhouetteGs(SilhouetteMethod):
    """Shadow volumes of silhouettes on any soup, by multiplicity in a geometry shader: what Milet et al. compare with.

    An edge is a line with adjacency, so it has up to two opposite vertices; edges with more are split by pairs of
    them, whose sides add up.
    """

    name: ClassVar[str] = "silhouette-gs"
    paper: ClassVar[str] = "Milet et al.; Peciva et al. 2013"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SilhouetteGsCaster":
        return SilhouetteGsCaster(scene, self, clock)


class SilhouetteGsCaster(SilhouetteCaster):
    """Edges between pairs of opposite vertices."""

    def upload(self, clock: Clock) -> None:
        topology, opposite = self.mesh.edges, self.mesh.opposite
        place = np.arange(len(opposite)) - np.repeat(topology.offsets[:-1], topology.count)
        first = np.flatnonzero(place % 2 == 0)
        edge = np.repeat(np.arange(len(topology.vertices)), topology.count)[first]
        a, b = topology.vertices[edge].T
        paired = place[first] + 1 < topology.count[edge]
        second = np.where(paired, opposite[np.minimum(first + 1, len(opposite) - 1)], a)
        self._lines = self.buffer(np.stack([opposite[first], a, b, second], axis=1).astype(np.int32))

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        self.draw("silhouette_gs.glsl", frame, self._lines, "LINES_ADJACENCY", self.multiplicity_constants)
