"""A shadow volume for every triangle, by a geometry shader."""

from dataclasses import dataclass
from typing import ClassVar

from umbrae.clock import Clock
from umbrae.methods.volumes.caster import VolumeCaster
from umbrae.methods.volumes.engine import Frame
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True)
class TriangleGs(VolumeMethod):
    """A shadow volume for every triangle, made by a geometry shader: what Milet et al. compare theirs with.

    No preprocessing, any soup. Neighbours draw the side between them twice, in opposite directions; both take its
    vertices in the same order, so the two cancel to the last bit, in a counter that takes signs.
    """

    name: ClassVar[str] = "triangle-gs"
    paper: ClassVar[str] = "Milet, Kobrtek, Zemcik, Peciva"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "TriangleGsCaster":
        return TriangleGsCaster(scene, self, clock)


class TriangleGsCaster(VolumeCaster):
    """Nothing but the triangles."""

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        self.draw("triangle_gs.glsl", frame, self.kept_index, "TRIANGLES")
