"""The passes of a frame, which all shadow volumes share: faces are drawn, and counted at the samples."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.gl.context import Session, session
from umbrae.gl.program import apply, program
from umbrae.gl.queries import samples_passed, stage
from umbrae.gl.state import count_faces, push_back, write_depth
from umbrae.gl.targets import CountTarget, count_target
from umbrae.light import Light
from umbrae.memory import require
from umbrae.methods.volumes.culling import Culling, Kept, ask_boxes
from umbrae.methods.volumes.mesh import VolumeMesh
from umbrae.methods.volumes.view import Rounding, far_plane, view_uniforms
from umbrae.projection import Uniforms
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

HERE = Path(__file__).parent
CONSTANTS = {"REFERENCE_EDGE": 0, "THREE_EDGE": 1, "NONE": 2}
"""What shaders call the values of `DETERMINISM`, in the same order."""
_BYTES_PER_SAMPLE = 24
STENCIL_LEVELS = 256


@dataclass(frozen=True, eq=False)
class Frame:
    """What the passes of one frame have in common."""

    light: Light
    behind: bool
    stencil: bool
    uniforms: Uniforms
    every_face: bool = False

    @property
    def constants(self) -> dict[str, int | str]:
        """For shaders that include `count.glsl`."""
        if self.every_face:
            return {"FLOAT_COUNTER": 1, "EVERY_FACE": 1}
        return {} if self.stencil else {"FLOAT_COUNTER": 1}


class CountingEngine(ABC):
    """A scene's geometry in OpenGL buffers, whose volumes' faces are counted. Derived casters draw the sides."""

    draws_dark_caps: ClassVar[bool] = False
    """Whether dark caps come with the sides."""
    draws_all_caps: ClassVar[bool] = False
    """Whether light and dark caps come with the sides."""
    culling: Culling | None = None
    """What tells which triangles can be left out of a frame."""
    kept: NDArray[np.bool_] | None = None
    """`(t,)` the triangles chosen; None for all."""

    def __init__(self, scene: Scene, name: str, mesh: VolumeMesh, clock: Clock) -> None:
        self.scene, self.name = scene, name
        self.session: Session = session()
        self.load(mesh, clock)

    def load(self, mesh: VolumeMesh, clock: Clock) -> None:
        """Put a mesh into buffers."""
        self.mesh = mesh
        # The last entry, -1, is background's, whose triangle is -1 as well.
        self._own_cap = np.append(self.mesh.cap_of, np.int32(-1))
        with self.session.current():
            self.vertices = self.buffer(self.mesh.positions)
            self.triangle_index = self.buffer(self.mesh.triangles)
            self.cap_of = self.buffer(self.mesh.cap_of[self.mesh.source])
            if len(self.mesh.triangles):
                self.upload(clock)
                self.upload_places(clock)
                self.kept = None
                self.choose(None)

    def move(self, mesh: VolumeMesh, clock: Clock) -> None:
        """Write anew where the vertices are; `mesh` has the triangles of the one before."""
        self.mesh = mesh
        with self.session.current():
            if len(mesh.triangles):
                self.vertices.write(mesh.positions.tobytes())
                self.upload_places(clock)

    def buffer(self, values: NDArray[Any]) -> Any:
        """An OpenGL buffer with these values; never empty, which OpenGL does not allow."""
        data = np.ascontiguousarray(values).tobytes() or bytes(4)
        return self.session.moderngl.buffer(data)

    def upload(self, clock: Clock) -> None:  # noqa: B027
        """Make what depends on the topology alone, with the context current."""

    def upload_places(self, clock: Clock) -> None:  # noqa: B027
        """Make what depends on where the vertices are, with the context current."""

    def choose(self, kept: NDArray[np.bool_] | None) -> None:
        """Draw, from now on, the volumes of the triangles `kept (t,)` alone; None for all. With the context current."""
        self.kept_index = self.triangle_index if kept is None else self.buffer(self.mesh.triangles[kept])

    @property
    def cap_constants(self) -> dict[str, int | str]:
        """How `caps.glsl` learns which way a triangle faces."""
        return {**CONSTANTS, "DETERMINISM": 0}

    def extract(self, frame: Frame, clock: Clock) -> dict[str, int]:
        """Do the work that depends on the light but not on the camera; returns counters."""
        return {}

    def casting(self, light: Light) -> NDArray[np.bool_] | None:
        """`(t,)` which triangles of the mesh have a volume under this light; None for all."""
        return None

    @property
    @abstractmethod
    def stencil(self) -> bool:
        """Whether the counter is a stencil."""

    @abstractmethod
    def counting(
        self, light: Light, camera: Camera, rounding: Rounding, casting: NDArray[np.bool_] | None, looks_through: bool
    ) -> tuple[bool, int, Camera]:
        """Whether to count behind the samples, where the counter starts, and a camera that stands on no face."""

    def capped(self, camera: Camera, behind: bool, casting: NDArray[np.bool_] | None) -> NDArray[np.int32]:
        """`(n,)` triangles of the mesh whose caps must be drawn: all that cast."""
        every = np.arange(len(self.mesh.triangles), dtype=np.int32)
        return every if casting is None else every[casting]

    @abstractmethod
    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        """Draw the side faces of all volumes."""

    def draw(
        self, file: str, frame: Frame, index: Any, mode: str, constants: Mapping[str, int | str] | None = None
    ) -> None:
        """Draw the vertices at `index` as primitives of `mode`, by the program of that file."""
        drawn = program(self.session, HERE / file, {**(constants or {}), **frame.constants})
        self.prepare_program(drawn, frame)
        context = self.session.moderngl
        array = context.vertex_array(drawn, [(self.vertices, "3f", "position")], index)
        self.issue(array, index, getattr(context, mode))

    def issue(self, array: Any, index: Any, mode: int) -> None:
        """Draw the whole array, whose vertices are those at `index`."""
        array.render(mode)

    def net_count(self, light: Light, samples: ViewSamples) -> NDArray[np.int32]:
        """`(h, w) int32` what all faces of all volumes add up to at each pixel, whatever their depth.

        Where volumes are closed, that is the number of them around the eye at every pixel, with nothing to compare
        depths with. `samples` are a picture with one sample in each pixel.
        """
        camera = self.camera_of(samples)
        if not len(self.mesh.triangles):
            return np.zeros(samples.shape, np.int32)
        with self.session.current() as current:
            self._keep(None)
            target = count_target(current, camera.width, camera.height, stencil=False)
            frame = Frame(light, True, False, view_uniforms(camera, light, self.mesh.scale, 0, 1))
            self.extract(frame, Clock())
            target.clear(0)
            count_faces(current, target, behind=True, depth_test=False)
            self.draw_sides(frame, samples)
            if not self.draws_all_caps:
                self.draw_caps(frame, samples, self.capped(camera, True, self.casting(light)))
            return target.read()

    def faces_before(self, light: Light, samples: ViewSamples, outlines: bool = False) -> NDArray[np.int32]:
        """`(h, w) int32` how many side faces of volumes lie between the eye and each pixel, or edges of such faces.

        For looking at the volumes. `samples` are a picture with one sample in each pixel.
        """
        camera = self.camera_of(samples)
        if not len(self.mesh.triangles):
            return np.zeros(samples.shape, np.int32)
        with self.session.current() as current:
            self._keep(None)
            target = count_target(current, camera.width, camera.height, stencil=False)
            frame = Frame(light, False, False, view_uniforms(camera, light, self.mesh.scale, 0, 1), every_face=True)
            self.extract(frame, Clock())
            self._draw_depth(target, frame, samples, 0)
            count_faces(current, target, behind=False, outlines=outlines)
            self.draw_sides(frame, samples)
            return target.read()

    def count_volumes(
        self, light: Light, samples: ViewSamples, rounding: Rounding, clock: Clock
    ) -> tuple[NDArray[np.int32], dict[str, int]]:
        """How many volumes hold each sample: `(h, w)` or `(h, w, s)`, what the counter says; and what was done."""
        camera = self.camera_of(samples)
        per_pixel = samples.shape[2] if len(samples.shape) == 3 else 1
        count = np.zeros((camera.height, camera.width, per_pixel), np.int32)
        stats: dict[str, int] = {}
        with self.session.current() as current:
            if len(self.mesh.triangles):
                require(samples.size * _BYTES_PER_SAMPLE, f"shadows by {self.name}")
                stats = self._fill(current, light, camera, samples, rounding, count, clock)
        return count.reshape(samples.shape), stats

    def _fill(
        self,
        current: Session,
        light: Light,
        camera: Camera,
        samples: ViewSamples,
        rounding: Rounding,
        count: NDArray[np.int32],
        clock: Clock,
    ) -> dict[str, int]:
        per_pixel, bits = count.shape[2], current.integer("GL_SUBPIXEL_BITS")
        with clock.span("eye"):
            casting = self.casting(light)
            near = casting
            if self.culling is not None:
                near = self.culling.around_eye(light, camera, rounding)
                near = near if casting is None else near & casting
            behind, start, camera = self.counting(light, camera, rounding, near, samples.looks_through)
        end = far_plane(self.scene, camera, light, self.mesh.scale)
        frames = [
            Frame(
                light,
                behind,
                self.stencil,
                {**view_uniforms(camera, light, self.mesh.scale, sample, per_pixel), "far_plane": end},
            )
            for sample in range(per_pixel)
        ]
        target = count_target(current, camera.width, camera.height, self.stencil)
        stats: dict[str, int] = {}
        capped = np.zeros(0, np.int32)
        updates, queries, drawn = 0, 0, np.zeros(len(self.mesh.triangles), bool)
        for sample, frame in enumerate(frames):
            part = samples if len(samples.shape) == 2 else _part(samples, sample)
            with stage(current, clock, "depth"):
                self._draw_depth(target, frame, part, start)
            before = self.kept
            if self.culling is not None:
                with stage(current, clock, "cull"):
                    found = self._cull(self.culling, target, frame, camera, rounding)
                queries += found.queries
                with clock.span("choose"):
                    self._keep(found.triangles)
            drawn |= True if self.kept is None else self.kept
            if sample == 0 or self.kept is not before:
                with stage(current, clock, "extract"):
                    stats = self.extract(frame, clock)
                with clock.span("contours"):
                    capped = self._capped(camera, behind, casting)
            count_faces(current, target, behind)
            with samples_passed(current) as passed:
                with stage(current, clock, "sides"):
                    self.draw_sides(frame, part)
                if len(capped):
                    with stage(current, clock, "caps"):
                        push_back(current, bits)
                        self.draw_caps(frame, part, capped)
            updates += passed[0]
            with clock.span("read"):
                count[..., sample] = target.read()
        stats |= {"zfail": int(behind), "volumes_at_eye": start, "caps": len(capped), "counter_updates": updates}
        stats["counter_bytes"] = target.counter_bytes
        if self.culling is not None:
            stats |= {"culled": int(np.count_nonzero(~drawn)), "queries": queries}
        return stats

    def _capped(self, camera: Camera, behind: bool, casting: NDArray[np.bool_] | None) -> NDArray[np.int32]:
        """`(n,)` triangles whose caps must be drawn, of those that are kept."""
        if self.draws_all_caps:
            return np.zeros(0, np.int32)
        if self.kept is not None:
            casting = self.kept if casting is None else casting & self.kept
        return self.capped(camera, behind, casting)

    def _keep(self, kept: NDArray[np.bool_] | None) -> None:
        if kept is not self.kept:
            self.kept = kept
            self.choose(kept)

    def _cull(self, culling: Culling, target: CountTarget, frame: Frame, camera: Camera, rounding: Rounding) -> Kept:
        """The triangles that must be drawn, by the depths of the samples in the target."""
        scale = self.mesh.scale
        far = np.array(frame.uniforms["far_plane"]) / (1.0, 1.0, 1.0, scale)
        # What ends in the plane, rounded, may lie beyond it: boxes end later.
        far[3] += sum(rounding.box_margin) if far[:3].any() else 0.0
        uniforms = {**frame.uniforms, "far_plane": (*far[:3], far[3] * scale)}
        return culling.kept(
            frame.light, camera, far, rounding,
            lambda lower, upper: ask_boxes(self.session, target, uniforms, lower * scale, upper * scale),
        )  # fmt: skip

    def _draw_depth(self, target: CountTarget, frame: Frame, samples: ViewSamples, start: int) -> None:
        target.clear(start % STENCIL_LEVELS if target.stencil else start)
        drawn = program(self.session, HERE / "depth.glsl")
        apply(drawn, frame.uniforms)
        # No verdict is asked of the background: nothing lies before it, or behind. In figures volumes stand before it.
        drawn["background"].value = 0.0 if frame.behind or frame.every_face else 1.0
        write_depth(self.session, target)
        assert samples.depth is not None
        self._texture("distances", samples.depth).use(0)
        drawn["distances"].value = 0
        self.session.moderngl.vertex_array(drawn, []).render(self.session.moderngl.TRIANGLES, vertices=3)

    def draw_caps(self, frame: Frame, samples: ViewSamples, capped: NDArray[np.int32]) -> None:
        constants: dict[str, int | str] = {**self.cap_constants, **frame.constants}
        if frame.behind:
            constants |= {"BEHIND": 1} if self.draws_dark_caps else {"BEHIND": 1, "DARK_CAPS": 1}
        drawn = program(self.session, HERE / "caps.glsl", constants)
        self.prepare_program(drawn, frame)
        triangles, caps = self.triangle_index, self.cap_of
        if len(capped) < len(self.mesh.triangles):
            triangles = self.buffer(self.mesh.triangles[capped])
            caps = self.buffer(self.mesh.cap_of[self.mesh.source[capped]])
        self.bind_own_caps(drawn, samples, caps)
        self.bind_sides(capped)
        array = self.session.moderngl.vertex_array(drawn, [(self.vertices, "3f", "position")], triangles)
        array.render(self.session.moderngl.TRIANGLES)

    def bind_sides(self, capped: NDArray[np.int32]) -> None:  # noqa: B027
        """Give `caps.glsl` the sides of these triangles, where it does not find them by itself."""

    def bind_own_caps(self, drawn: Any, samples: ViewSamples, caps: Any) -> None:
        """Give a program that includes `own.glsl` the samples' own caps, and the caps of its primitives."""
        self._texture("own_cap", self._own_cap[samples.triangle]).use(0)
        drawn["own_cap"].value = 0
        caps.bind_to_storage_buffer(0)

    def prepare_program(self, drawn: Any, frame: Frame) -> None:
        """Set the uniforms of a program that counts faces."""
        apply(drawn, frame.uniforms)
        if "entering" in drawn:
            drawn["entering"].value = -1.0 if frame.behind else 1.0

    def _texture(self, name: str, values: NDArray[Any]) -> Any:
        """A texture with one channel of 32 bits, `(h, w)` values from the top; kept and written anew."""
        height, width = values.shape
        key = ("texture", name, width, height)
        kept = self.session.kept
        if key not in kept:
            for other in [other for other in kept if other[:2] == key[:2]]:
                kept.pop(other).release()
            kept[key] = self.session.moderngl.texture((width, height), 1, dtype="f4" if values.dtype == "f4" else "i4")
        kept[key].write(np.ascontiguousarray(values))
        return kept[key]

    def camera_of(self, samples: ViewSamples) -> Camera:
        camera, shape = samples.camera, samples.shape
        if camera is None or samples.depth is None or len(shape) < 2 or shape[:2] != (camera.height, camera.width):
            raise InputError(
                f"{self.name}: wanted the samples of a whole picture, got {'x'.join(map(str, shape))} points "
                "without one; the method `frustum` takes points"
            )
        return camera


def _part(samples: ViewSamples, index: int) -> ViewSamples:
    """One sample of each pixel, as a picture `(h, w)`."""
    assert samples.depth is not None
    return ViewSamples(
        triangle=samples.triangle[..., index],
        barycentric=samples.barycentric[..., index, :],
        side=samples.side[..., index],
        position=samples.position[..., index, :],
        covered=samples.covered[..., index],
        depth=samples.depth[..., index],
        camera=samples.camera,
    )
