"""A shadow volume for every triangle, by tessellation in a single pass."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.gl.program import program
from umbrae.methods.volumes.caster import VolumeCaster
from umbrae.methods.volumes.engine import HERE, Frame
from umbrae.methods.volumes.method import VolumeMethod
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True)
class TriangleTsSingle(VolumeMethod):
    """A whole shadow volume for every triangle from one patch (Milet et al., section 2.1, Figure 3).

    The paper found it five times slower than two passes; it is kept to show that.

    Deviations from the paper: outer levels (1, 9, 1, 9) and inner (9, 1) instead of 5, so that the volume does not
    depend on the diagonal along which the tessellator splits a quad, which OpenGL leaves open. The light cap is
    pushed out of the way only where it is the sample's own triangle, and back by rounding elsewhere. It is drawn for
    z-pass as well.
    """

    name: ClassVar[str] = "triangle-ts-single"
    paper: ClassVar[str] = "Milet, Kobrtek, Zemcik, Peciva"

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "TriangleTsSingleCaster":
        return TriangleTsSingleCaster(scene, self, clock)


class TriangleTsSingleCaster(VolumeCaster):
    """The triangles, each with its own number for a fourth vertex."""

    draws_all_caps = True
    inner_faces = True

    def upload(self, clock: Clock) -> None:
        triangles = self.mesh.triangles
        numbers = np.arange(len(triangles), dtype=np.int32)
        self._numbered = np.column_stack([triangles, numbers])

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        self._quads = self.buffer(self._numbered if kept is None else self._numbered[kept])

    def upload_places(self, clock: Clock) -> None:
        # Numbers are indices of vertices to OpenGL: there must be as many.
        padding = np.zeros((max(0, len(self.mesh.triangles) - len(self.mesh.positions)), 3), np.float32)
        self._points = self.buffer(np.concatenate([self.mesh.positions, padding]))

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        step = 2.0 ** -self.session.integer("GL_SUBPIXEL_BITS")
        constants = {**frame.constants, "PUSH_BACK": f"{step:.10f}"}
        drawn = program(self.session, HERE / "triangle_ts_single.glsl", constants)
        self.prepare_program(drawn, frame)
        self.bind_own_caps(drawn, samples, self.cap_of)
        context = self.session.moderngl
        context.patch_vertices = 4
        context.vertex_array(drawn, [(self._points, "3f", "position")], self._quads).render(context.PATCHES)
