"""What all smooth methods share: their options, and the surface that they cast the shadow of."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import number, shown
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.hermite import Curves, curved, phong
from umbrae.geometry.smooth_mesh import moved_mesh, smooth_mesh
from umbrae.geometry.smooth_surface import Bend, SmoothSurface, Tolerance, smooth_surface
from umbrae.light import Light
from umbrae.mask import Guarantee
from umbrae.methods.method import Method
from umbrae.methods.smooth.receiver_scale import ReceiverScale
from umbrae.parallel import expand, kernel, run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_BENT: dict[str, Bend] = {"smooth": curved, "phong": phong}
SILHOUETTES = ("smooth", "accurate", "discrete", "phong")

FINE_PX = 0.25
"""What chords may be off in a picture where no bound is given."""

_FINE = 2.0**-12
"""The same without a picture: of the scene's extent."""

_SAMPLES_PER_TASK = 65536


@dataclass(frozen=True)
class SmoothMethod(Method):
    """A method whose shadows have smooth boundaries.

    Options
    -------
    silhouette
        `smooth`, `accurate` (not bent), `discrete` (that of the triangles, whatever the normals), or `phong`, the
        paper's counter-example (its Figure 4): bent by Phong tessellation's quadratic curves, which leave kinks.
    epsilon
        How far chords may lie from the curves, in world units: the paper's bound.
    epsilon_px
        How many pixels of the picture their shadows may be off, wherever light falls on the samples at 3.6 degrees or
        more (see `receiver_scale`). Where both bounds are given both hold, up to 64 chords for a curve. Where neither
        is, a quarter of a pixel, or for samples without a camera 1/4096 of the scene's extent.
    """

    silhouette: str = "smooth"
    epsilon: float | None = None
    epsilon_px: float | None = None

    guarantee: ClassVar[Guarantee] = Guarantee.NONE

    def __post_init__(self) -> None:
        if self.silhouette not in SILHOUETTES:
            wanted = f"wanted one of {', '.join(SILHOUETTES)}"
            raise OptionError(f"{self.name}: silhouette: {wanted}, got {shown(self.silhouette)}")
        for option, value in (("epsilon", self.epsilon), ("epsilon_px", self.epsilon_px)):
            if value is not None and not number(value, f"{self.name}: {option}") > 0:
                raise OptionError(f"{self.name}: {option}: wanted a positive number, got {value}")


class Silhouettes:
    """A scene's smooth mesh, and the last surface that was asked for: silhouettes of a light at rest are kept."""

    def __init__(self, scene: Scene, method: SmoothMethod, clock: Clock | None) -> None:
        self.scene, self.method = scene, method
        with (clock or Clock()).span("edges"):
            self.mesh = smooth_mesh(scene.positions, scene.triangles, self._normals)
        self._kept: tuple[bytes, ViewSamples | None, SmoothSurface] | None = None

    def move(self, scene: Scene, clock: Clock | None) -> None:
        """Be those of a moved copy of the scene."""
        self.scene, self._kept = scene, None
        with (clock or Clock()).span("edges"):
            moved = moved_mesh(self.mesh, scene.positions, self._normals)
            self.mesh = moved or smooth_mesh(scene.positions, scene.triangles, self._normals)

    @property
    def _normals(self) -> NDArray[np.float32] | None:
        return None if self.method.silhouette == "discrete" else self.scene.normals

    def surface(self, light: Light, samples: ViewSamples) -> SmoothSurface:
        """The surface that casts this light's shadow on these samples, the same object as long as nothing changes."""
        in_picture = self._in_picture(samples)
        bend = _BENT.get(self.method.silhouette)
        about = samples if in_picture is not None and bend else None
        key = light.position.tobytes()
        if self._kept is None or self._kept[0] != key or self._kept[1] is not about:
            tolerance = self._tolerance(light, samples) if bend else None
            self._kept = key, about, smooth_surface(self.mesh, light.position, tolerance, bend or curved)
        return self._kept[2]

    def turned_away(self, surface: SmoothSurface, samples: ViewSamples) -> NDArray[np.bool_]:
        """`(n,)` samples at which the smooth surface that they lie on turns away from the light: they are in shadow."""
        dark = np.zeros(samples.size, bool)
        raw = samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2), samples.side.reshape(-1)
        soup = self.scene.triangles, surface.chain[: len(self.scene.triangles)], self.mesh.turned, surface.faces.values

        def task(i: int) -> None:
            leave_dark(*raw, *soup, i * _SAMPLES_PER_TASK, min((i + 1) * _SAMPLES_PER_TASK, samples.size), dark)

        run(task, -(-samples.size // _SAMPLES_PER_TASK))
        return dark

    def _in_picture(self, samples: ViewSamples) -> float | None:
        """The bound in pixels, if one applies."""
        epsilon, epsilon_px = self.method.epsilon, self.method.epsilon_px
        if samples.camera is None:
            return None
        return FINE_PX if epsilon is None and epsilon_px is None else epsilon_px

    def _tolerance(self, light: Light, samples: ViewSamples) -> Tolerance:
        """How far chords may lie from curves, by the method's bounds."""
        in_picture, in_world = self._in_picture(samples), self.method.epsilon
        if in_world is None:
            extent = float((self.scene.bounds[1] - self.scene.bounds[0]).max())
            in_world = np.inf if in_picture is not None else _FINE * extent
        if in_picture is None:
            return lambda curves: np.full(len(curves.p0), in_world)
        scale = ReceiverScale.of(self.scene, self.mesh.facets, light, samples)

        def within(curves: Curves) -> NDArray[np.float64]:
            with np.errstate(divide="ignore"):
                return np.minimum(in_picture / scale.pixels_per_unit(curves), in_world)

        return within


@expand
def way_at(own, u, v, triangles, chain, turned, values):
    """How the oriented surface lies at a place of a soup's triangle, against its winding (see `geometry.contours`).

    Its `chain (t,)`; of a triangle that was cut, whose chain is 0, that of the piece there.
    """
    way = np.int64(chain[own])
    if way == 0 and turned[own] != 0:
        a, b, c = values[triangles[own, 0]], values[triangles[own, 1]], values[triangles[own, 2]]
        way = np.int64(turned[own] if a + u * (b - a) + v * (c - a) >= 0.0 else -turned[own])
    return way


@kernel
def leave_dark(triangle, barycentric, side, triangles, chain, turned, values, start, stop, dark):
    """Set `dark` for samples `start` to `stop` where the surface shows them the side away from the light."""
    for index in range(start, stop):
        own = triangle[index]
        if own >= 0 and side[index] != 0:
            u, v = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1])
            dark[index] = side[index] * way_at(own, u, v, triangles, chain, turned, values) < 0
