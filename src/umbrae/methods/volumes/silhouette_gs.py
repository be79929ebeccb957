"""Silhouettes by multiplicity, in a geometry shader."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.patches import edge_patches, split_edges
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
        self._parts = split_edges(self.mesh.edges, 2)

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        patches = edge_patches(self.mesh.edges, self.mesh.opposite, self._parts, kept)
        # Where there is no second opposite vertex, the lower end takes its place.
        lines = [ids[:, [2, 0, 1, 3 % (2 + size)]] for size, ids in patches.items()]
        self._lines = self.buffer(np.concatenate(lines))

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        self.draw("silhouette_gs.glsl", frame, self._lines, "LINES_ADJACENCY", self.multiplicity_constants)
