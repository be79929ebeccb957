"""Shadows with smooth boundaries of coarse meshes, as shadow volumes on OpenGL."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.geometry.smooth_surface import SmoothSurface
from umbrae.gl.program import program
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.method import Caster, require_solid
from umbrae.methods.smooth.cancelling import settle_doubts
from umbrae.methods.smooth.casting import casting_of
from umbrae.methods.smooth.light_cells import behind
from umbrae.methods.smooth.silhouette import Silhouettes, SmoothMethod
from umbrae.methods.volumes.engine import CountingEngine, Frame
from umbrae.methods.volumes.eye import light_spread
from umbrae.methods.volumes.mesh import VolumeMesh
from umbrae.methods.volumes.view import Rounding
from umbrae.projection import unit_scale
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

HERE = Path(__file__).parent


@dataclass(frozen=True)
class SmoothGl(SmoothMethod):
    """Smooth shadow boundaries by shadow volumes, after Mattausch, Scherzer, Wimmer and Igarashi 2012.

    Silhouettes are found on all CPU cores, as for `smooth`; curves are cut into chords, extruded, and joined to the
    mesh in tessellation shaders: what the paper leaves to future work. Volumes are closed, with the triangles cut
    along the silhouette as light caps; faces are counted behind the samples (z-fail).

    Deviations from the paper: those of `smooth`; a patch for each part of the contour instead of a strip for each
    loop; one float counter that takes steps, because both halves of a surface, the lit one and the unlit one turned
    over, bound the volume at the silhouette. What cancels in the counter is looked at once more on the CPU: all samples
    that it leaves lit, against the few triangles that may count backwards and their neighbours (see `cancelling`).

    Options
    -------
    look_twice
        Whether to do so; else coarse meshes may leave thin lines of light in their shadows.
    silhouette, epsilon, epsilon_px
        See `SmoothMethod`.
    """

    look_twice: bool = True

    name: ClassVar[str] = "smooth-gl"
    paper: ClassVar[str] = "Mattausch, Scherzer, Wimmer, Igarashi 2012"
    engine: ClassVar[str] = "OpenGL"
    accepts: ClassVar[tuple[str, ...]] = ("pictures",)

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SmoothGlCaster":
        return SmoothGlCaster(scene, self, clock)


class SmoothGlCaster(Caster):
    """The mesh with its edges, and the last light's volumes."""

    def __init__(self, scene: Scene, method: SmoothGl, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        self.scene, self.method = scene, method
        self.silhouettes = Silhouettes(scene, method, clock)
        self._kept: tuple[SmoothSurface, SmoothVolumes] | None = None

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene, self._kept = scene, None
        self.silhouettes.move(scene, clock)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        with clock.span("contours"):
            volumes = self.volumes(light, samples)
        return volumes.shadow(light, samples, clock)

    def volumes(self, light: Light, samples: ViewSamples) -> "SmoothVolumes":
        """The volumes of this light for these samples."""
        surface = self.silhouettes.surface(light, samples)
        if self._kept is None or self._kept[0] is not surface:
            self._kept = surface, SmoothVolumes(self.scene, self.method, self.silhouettes, surface, light)
        return self._kept[1]


class SmoothVolumes(CountingEngine):
    """The volumes of one surface: its triangles as caps, and the parts of its boundary."""

    stencil = False
    _PART = np.dtype([("corners", np.float32, (6, 3)), ("times", np.int32), ("chords", np.int32)])
    _CONTENT = ("base_start", "base_end", "start", "end", "along_start", "along_end", "times", "chords")

    def __init__(
        self, scene: Scene, method: SmoothGl, silhouettes: Silhouettes, surface: SmoothSurface, light: Light
    ) -> None:
        scale, same = unit_scale(scene), silhouettes.mesh.same
        used = np.flatnonzero(surface.chain)
        self.silhouettes, self.surface, self._side = silhouettes, surface, surface.chain[used]
        self._crossed = casting_of(silhouettes, surface, light) if method.look_twice else None
        positions = (surface.positions.astype(np.float64) * scale).astype(np.float32)
        triangles = np.ascontiguousarray(surface.triangles[used])
        super().__init__(
            scene, method.name, VolumeMesh(positions, scale, triangles, triangles, surface.source[used], same), Clock()
        )

    def upload(self, clock: Clock) -> None:
        bounds, curves, positions = self.surface.bounds, self.surface.bounds.curves, self.mesh.positions
        parts = np.empty(len(bounds.times), self._PART)
        for place, vertex in enumerate((*bounds.base.T, *bounds.ends.T)):
            parts["corners"][:, place] = positions[vertex]
        parts["corners"][:, 4], parts["corners"][:, 5] = curves.t0 * self.mesh.scale, curves.t1 * self.mesh.scale
        parts["times"], parts["chords"] = bounds.times, self.surface.chords
        banded = (bounds.base != bounds.ends).any(axis=1) | (self.surface.chords > 1)
        self._parts, self._banded = self._patches(parts), self._patches(parts[banded])

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        clock = clock or Clock()
        rounding = self._rounding(light, self.camera_of(samples))
        count, stats = self.count_volumes(light, samples, rounding, clock)
        stats["contour_edges"] = int(self.surface.chords.sum())
        with clock.span("mask"):
            away = self.silhouettes.turned_away(self.surface, samples).reshape(samples.shape)
            in_shadow = ((count != 0) | away) & samples.covered
        with clock.span("doubts"):
            self._look_twice(light, samples, in_shadow)
        with clock.span("mask"):
            if self.surface.is_the_soup:
                band = rounding.band(samples, self.silhouettes.mesh.facets)
                return ShadowMask(in_shadow, Guarantee.BANDED, band, stats=stats)
        return ShadowMask(in_shadow, Guarantee.NONE, stats=stats)

    def _look_twice(self, light: Light, samples: ViewSamples, in_shadow: NDArray[np.bool_]) -> None:
        """Darken samples that the counter leaves lit, because of crossings that must not cancel."""
        flat, crossed = in_shadow.reshape(-1), self._crossed
        if crossed is not None and not self.surface.is_the_soup:
            lit = samples.covered.reshape(-1) & ~flat
            backwards = crossed.soup.triangles[crossed.weight < 0]
            doubt = behind(crossed.soup.positions, backwards, light, samples, lit)
            settle_doubts(crossed, light, samples, doubt, flat)

    def _rounding(self, light: Light, camera: Camera) -> Rounding:
        spread = 2.0
        if not light.is_directional:
            spread = light_spread(self.mesh.positions, self.surface.bounds.base, light.position * self.mesh.scale)
        with self.session.current() as current:
            return Rounding.of(self.scene, camera, current.integer("GL_SUBPIXEL_BITS"), spread)

    def counting(
        self, light: Light, camera: Camera, rounding: Rounding, casting: NDArray[np.bool_] | None, looks_through: bool
    ) -> tuple[bool, int, Camera]:
        return True, 0, camera

    @property
    def cap_constants(self) -> dict[str, int | str]:
        return {**super().cap_constants, "FACING_FROM_BUFFER": 1}

    def bind_sides(self, capped: NDArray[np.int32]) -> None:
        self.buffer(self._side[capped]).bind_to_storage_buffer(1)

    def draw_sides(self, frame: Frame, samples: ViewSamples) -> None:
        self._draw_patches(frame, self._parts, {"SIDES": 1})

    def draw_caps(self, frame: Frame, samples: ViewSamples, capped: NDArray[np.int32]) -> None:
        super().draw_caps(frame, samples, capped)
        self.draw_bands(frame)
        if not frame.light.is_directional or any(frame.uniforms["far_plane"][:3]):  # else a point
            self._draw_patches(frame, self._banded, {"DARK_CAPS": 1})

    def draw_bands(self, frame: Frame) -> None:
        """Close the volumes between the mesh and the contour."""
        self._draw_patches(frame, self._banded, {})

    def _patches(self, parts: NDArray[Any]) -> tuple[Any, int]:
        return self.buffer(parts), len(parts)

    def _draw_patches(self, frame: Frame, patches: tuple[Any, int], constants: dict[str, int | str]) -> None:
        buffer, count = patches
        drawn = program(self.session, HERE / "contour.glsl", {**constants, **frame.constants})
        self.prepare_program(drawn, frame)
        if count:
            context = self.session.moderngl
            context.patch_vertices = 1
            array = context.vertex_array(drawn, [(buffer, "3f 3f 3f 3f 3f 3f 1i 1i", *self._CONTENT)])
            array.render(context.PATCHES, vertices=count)
