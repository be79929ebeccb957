"""Silhouettes by multiplicity, in tessellation shaders."""

from dataclasses import dataclass
from typing import Any, ClassVar

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
class SilhouetteTs(SilhouetteMethod):
    """Shadow volumes of silhouettes on any soup, by tessellation (Milet et al., section 2.2, Algorithms 2 to 5).

    Each edge is a patch together with its opposite vertices; the control shader finds its multiplicity by the
    reference edge, the evaluation shader makes that many overlapping quads of it, or one that counts as often.

    Deviations from the paper: patches are drawn in groups of equal size, so they need no count and no padding (Figure
    5); edges with more opposite vertices than a patch holds are split, and their sides add up; Algorithm 5 has the
    factor 2 m - 1; the order of vertices is that of their indices.
    """

    name: ClassVar[str] = "silhouette-ts"
    paper: ClassVar[str] = "Milet, Kobrtek, Zemcik, Peciva"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SilhouetteTsCaster":
        return SilhouetteTsCaster(scene, self, clock)


class SilhouetteTsCaster(SilhouetteCaster):
    """Edges in groups by the number of their opposite vertices."""

    def upload(self, clock: Clock) -> None:
        self._parts = split_edges(self.mesh.edges, self.session.integer("GL_MAX_PATCH_VERTICES") - 2)

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        made = edge_patches(self.mesh.edges, self.mesh.opposite, self._parts, kept)
        self._patches: dict[int, Any] = {size + 2: self.buffer(ids) for size, ids in made.items() if len(ids)}

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        for size, index in self._patches.items():
            self.session.moderngl.patch_vertices = size
            self.draw("silhouette_ts.glsl", frame, index, "PATCHES", self.multiplicity_constants)
