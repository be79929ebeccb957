"""A shadow volume for every triangle, by tessellation in two passes."""

from dataclasses import dataclass
from typing import ClassVar

from umbrae.clock import Clock
from umbrae.methods.volumes.caster import VolumeCaster
from umbrae.methods.volumes.engine import Frame
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True)
class TriangleTs(VolumeMethod):
    """A shadow volume for every triangle, made by tessellation (Milet et al., section 2.1, Algorithm 1).

    A first pass draws sides and dark caps, a second one light caps. No preprocessing, any soup.

    Deviation from the paper: corners come in ascending order and the triangle's side is decided by the exact
    predicate's twin, so all triangles have their fronts outside whatever their winding. Neighbours draw the side
    between them in opposite directions, and OpenGL leaves open along which diagonal the ring is split: where the two
    splits differ, they cancel up to the rounding of depth only.
    """

    name: ClassVar[str] = "triangle-ts"
    paper: ClassVar[str] = "Milet, Kobrtek, Zemcik, Peciva"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "TriangleTsCaster":
        return TriangleTsCaster(scene, self, clock)


class TriangleTsCaster(VolumeCaster):
    """Nothing but the triangles."""

    draws_dark_caps = True
    inner_faces = True

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        self.session.moderngl.patch_vertices = 3
        self.draw("triangle_ts.glsl", frame, self.kept_index, "PATCHES")
