"""Shadow volumes of a scene's triangles: where to count from, and the band."""

import dataclasses
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.edges import still_welded, weld
from umbrae.geometry.normals import facet_normals
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.method import Caster, require_solid
from umbrae.methods.volumes.culling import Culling
from umbrae.methods.volumes.engine import CONSTANTS, STENCIL_LEVELS, CountingEngine
from umbrae.methods.volumes.eye import contour_vertices, count_at_eye, crossed_caps, light_spread
from umbrae.methods.volumes.mesh import VolumeMesh, volume_mesh
from umbrae.methods.volumes.method import DETERMINISM, SilhouetteMethod, VolumeMethod
from umbrae.methods.volumes.view import Rounding
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_ASIDE = ((0.53, 0.61, 0.59), (-0.67, 0.41, 0.62), (0.44, -0.72, 0.54), (0.71, 0.49, -0.50), (-0.38, -0.57, 0.73))
"""Directions of no particular meaning."""


class VolumeCaster(CountingEngine, Caster):
    """A scene's welded geometry. Methods derive from it and draw the sides of the volumes."""

    inner_faces: ClassVar[bool] = False
    """Whether opposite sides of neighbours may fail to cancel in the last bits (see `ShadowMask.inner_faces`).

    With a stencil they always may: it takes no sign, so one of the two is drawn with its vertices in another order.
    """

    def __init__(self, scene: Scene, method: VolumeMethod, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        clock = clock or Clock()
        self.method = method
        self._normals = facet_normals(scene.positions, scene.triangles)
        super().__init__(scene, method.name, self._weld(scene, clock), clock)
        self._find_objects(clock)

    def _find_objects(self, clock: Clock) -> None:
        if self.method.culling:
            source = self.mesh.source
            with clock.span("objects"):
                self.culling = Culling(self.scene.positions, self.scene.triangles[source], self.scene.object_id[source])

    def _weld(self, scene: Scene, clock: Clock) -> VolumeMesh:
        with clock.span("weld"):
            self._welded = weld(scene.positions)
            return volume_mesh(scene, self._welded)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        clock = clock or Clock()
        self.scene = scene
        self._normals = facet_normals(scene.positions, scene.triangles)
        if still_welded(self._welded, scene.positions):
            self.move(self.mesh.moved(scene, self._welded), clock)
            if self.culling is not None:
                self.culling.move(scene.positions, scene.triangles[self.mesh.source])
        else:
            self.load(self._weld(scene, clock), clock)
            self._find_objects(clock)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        clock = clock or Clock()
        self.check(light, samples)
        rounding = self._rounding(light, samples)
        count, stats = self.count_volumes(light, samples, rounding, clock)
        with clock.span("mask"):
            in_shadow = (count != 0) & samples.covered
            band = rounding.band(samples, self._normals)
        return ShadowMask(in_shadow, self.promise, band, self.inner_faces or self.stencil, stats)

    def count(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> NDArray[np.int32]:
        """`(h, w)` or `(h, w, s) int32` how many volumes hold each sample: what the counter says in the end."""
        self.check(light, samples)
        return self.count_volumes(light, samples, self._rounding(light, samples), clock or Clock())[0]

    @property
    def promise(self) -> Guarantee:
        """The guarantee with the options that were chosen."""
        return Guarantee.BANDED

    def _rounding(self, light: Light, samples: ViewSamples) -> Rounding:
        spread = 2.0
        if not light.is_directional:
            spread = light_spread(self.mesh.positions, self.mesh.edges.vertices, light.position * self.mesh.scale)
        with self.session.current() as current:
            bits = current.integer("GL_SUBPIXEL_BITS")
        return Rounding.of(self.scene, self.camera_of(samples), bits, spread)

    @property
    def stencil(self) -> bool:
        """Whether the counter is a stencil."""
        if self.method.counter == "auto":
            return len(self.mesh.triangles) < STENCIL_LEVELS
        return self.method.counter == "stencil"

    def counting(
        self,
        light: Light,
        camera: Camera,
        rounding: Rounding,
        casting: NDArray[np.bool_] | None,
        looks_through: bool,
    ) -> tuple[bool, int, Camera]:
        """Whether to count behind the samples, where the counter starts, and a camera that stands on no face.

        A face through the eye is a line in the picture, which clipping takes for anything. So an eye on one is moved
        off it, by as much as rounding does.
        """
        scene, distance = self.scene, rounding.world + rounding.turned
        triangles = scene.triangles if casting is None else scene.triangles[self.mesh.source[casting]]
        held = count_at_eye(scene.positions, triangles, light.position, camera.eye, distance)
        if looks_through and self.method.counting == "zpass":
            raise OptionError(
                f"{self.method.name}: counting='zpass' cannot be trusted here: the samples are of a scene that lets "
                "light through, so surfaces may lie before them; 'auto' takes zfail"
            )
        if not held.clear and self.method.counting == "zpass":
            raise OptionError(
                f"{self.method.name}: counting='zpass' cannot be trusted here: the eye is within {distance:.3g} of a "
                "shadow volume's face; 'auto' takes zfail"
            )
        if held.clear:
            behind = looks_through or self.method.counting == "zfail"
            return (True, 0, camera) if behind else (False, held.volumes, camera)
        for direction in _ASIDE:
            moved = dataclasses.replace(camera, eye=camera.eye + rounding.world * np.array(direction))
            if count_at_eye(scene.positions, triangles, light.position, moved.eye, rounding.world / 8).clear:
                return True, 0, moved
        return True, 0, camera

    def capped(self, camera: Camera, behind: bool, casting: NDArray[np.bool_] | None) -> NDArray[np.int32]:
        """`(n,)` triangles of the mesh whose caps must be drawn: all of them for z-fail, few for z-pass (see `eye`)."""
        mesh, topology = self.mesh, self.mesh.edges
        if casting is None:
            casting = np.ones(len(mesh.triangles), bool)
        if behind:
            return np.flatnonzero(casting).astype(np.int32)
        wanted = np.zeros(len(mesh.positions), bool)
        wanted[mesh.triangles[casting]] = True
        at_contour = contour_vertices(
            mesh.positions, mesh.triangles, topology.offsets, topology.triangle, mesh.sign, topology.vertices,
            camera.eye * mesh.scale, wanted,
        )  # fmt: skip
        world_to_clip = camera.world_to_clip
        world_to_clip[:, 3] *= mesh.scale
        # Room for rounding at the near plane, and two pixels for samples off a pixel's centre.
        near, slack = 1.001 * camera.near * mesh.scale, 1e-3 + 2.0 / min(camera.width, camera.height)
        crossed = crossed_caps(mesh.positions, mesh.triangles, at_contour, casting, world_to_clip, near, slack)
        return np.flatnonzero(crossed).astype(np.int32)


class SilhouetteCaster(VolumeCaster):
    """A caster whose shaders include `multiplicity.glsl`."""

    method: SilhouetteMethod

    @property
    def multiplicity_constants(self) -> dict[str, int | str]:
        """How shaders decide a triangle's side."""
        return {**CONSTANTS, "DETERMINISM": DETERMINISM.index(self.method.determinism)}

    @property
    def cap_constants(self) -> dict[str, int | str]:
        return self.multiplicity_constants

    @property
    def promise(self) -> Guarantee:
        return Guarantee.BANDED if self.method.determinism == "reference-edge" else Guarantee.NONE
