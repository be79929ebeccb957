"""What every shadow algorithm looks like from outside."""

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from umbrae.checks import shown, whole
from umbrae.clock import Clock
from umbrae.errors import InputError, OptionError
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import SOLID, transmission_of

LIGHT_SAMPLES = 32

TRANSPARENCY = ("exact", "stochastic")


class Caster(ABC):
    """A scene's geometry, prepared once by a method; asked once per light and set of samples; moved frame by frame."""

    scene: Scene
    takes_area_lights: ClassVar[bool] = False

    def check(self, light: Light, samples: ViewSamples) -> None:
        """Refuse samples that were made for another scene, and a light with a size if `shadow` takes none."""
        samples.check(self.scene)
        if light.is_area and not self.takes_area_lights:
            raise InputError("wanted a light without a size; umbrae.shadow takes the mean over points of it")

    @abstractmethod
    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        """Decide every sample; marks its stages as spans on `clock`.

        Starts with `check`.
        """

    @abstractmethod
    def _place(self, scene: Scene, clock: Clock | None) -> None:
        """Become what `Method.prepare` would make of this moved copy of the scene; keep what topology alone decides."""

    def follow(self, scene: Scene, clock: Clock | None = None) -> None:
        """Cast the shadow of `scene` from now on, a moved copy of the caster's (`Scene.moved`)."""
        if scene.family is not self.scene.family:
            raise InputError("Caster.follow: wanted a moved copy of the caster's scene, got another scene")
        self._place(scene, clock)

    def update(self, positions: ArrayLike, normals: ArrayLike | None = None, clock: Clock | None = None) -> Scene:
        """Move the vertices, and cast the shadow of that from now on; returns the moved scene, which is `scene` now.

        Samples of the scene before are refused from then on, unless they are free points.

        Parameters
        ----------
        positions
            `(v, 3)` in the scene's coordinates.
        normals
            `(v, 3)` those that belong to them; by default the scene's, as they are.

        Raises
        ------
        InputError
            For arrays of another shape, or coordinates that a scene does not take.
        """
        self.follow(self.scene.moved(positions, normals), clock)
        return self.scene


@dataclass(frozen=True)
class Method(ABC):
    """A shadow algorithm. Its dataclass fields are its options, its docstring is its manual page.

    `engine` is what it runs on, "CPU" or "OpenGL". `accepts` are the kinds of samples that it takes: whole "pictures"
    with the camera that sees them, "points" of any shape; "transparency": scenes whose surfaces let light through; and
    "area lights", if `Caster.shadow` takes lights with a size. For all others, `area_average.cast_shadow` makes the
    mean over `light_samples` lights without one.
    """

    light_samples: int = field(default=LIGHT_SAMPLES, kw_only=True)

    name: ClassVar[str]
    paper: ClassVar[str]
    guarantee: ClassVar[Guarantee]
    engine: ClassVar[str] = "CPU"
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points")

    @abstractmethod
    def prepare(self, scene: Scene, clock: Clock | None = None) -> Caster:
        """Do the work that depends on the geometry alone."""

    def options(self) -> dict[str, Any]:
        """Option values by name."""
        return dataclasses.asdict(self)


def check_transparency(name: str, transparency: str, seed: int) -> None:
    """Refuse values of these options that a method does not know."""
    if transparency not in TRANSPARENCY:
        raise OptionError(f"{name}: transparency: wanted one of {', '.join(TRANSPARENCY)}, got {shown(transparency)}")
    if not 0 <= whole(seed, f"{name}: seed") < 1 << 63:
        raise OptionError(f"{name}: seed: wanted 0 to 2**63 - 1, got {seed}")


def require_solid(scene: Scene, name: str) -> None:
    """Refuse a scene that lets light through, for a method that cannot."""
    table = transmission_of(scene)
    if table is None:
        return
    used = np.unique(scene.material_id[table.kind != SOLID])
    named = ", ".join(shown(scene.materials[index].name or f"number {index}") for index in used[:3])
    raise InputError(
        f"{name}: wanted solid casters, but {len(used)} material{'s' * (len(used) > 1)} let light through ({named}"
        f"{', ...' * (len(used) > 3)}): use method frustum, or take every surface as solid (Scene.opaque(), --opaque)"
    )
