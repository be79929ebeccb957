"""Where light comes from."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import Vector, array, number, shown, vector
from umbrae.errors import InputError


@dataclass(frozen=True, eq=False)
class Light:
    """A light in homogeneous coordinates; made by `Light.point`, `Light.directional` or `Light.sun`.

    Attributes
    ----------
    position
        `(4,)` float32 `(x, y, z, w)`. `w = 1`: a point that shines in all directions. `w = 0`: parallel light from
        the direction `(x, y, z)`, that is, the direction towards the light. These float32 numbers are the light:
        they are rounded once, here, and every method computes with just them.
    color
        Linear RGB.
    intensity
        Factor on the colour. A surface that faces the light at right angles receives `color * intensity`,
        at any distance.
    radius
        World units, for a point light: that of the sphere that shines. It is sampled as the disc of that radius around
        `position` that faces the view sample (see `methods.area_samples`); inside the sphere as well.
    angular_diameter
        Degrees below 180, for a directional light: directions up to half of it away from `position` shine alike.
        The sun's is 0.53.
    """

    position: NDArray[np.float32]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    radius: float = 0.0
    angular_diameter: float = 0.0

    def __post_init__(self) -> None:
        given = array(self.position, "Light.position")
        if given.shape != (4,) or given.dtype.kind not in "iuf":
            raise InputError(f"Light.position: wanted 4 homogeneous coordinates, got {shown(self.position)}")
        with np.errstate(over="ignore"):
            position = given.astype(np.float32) + np.float32(0)  # turns -0 into 0
        if not np.isfinite(position).all() or np.abs(position).max() > 1e18:
            raise InputError(f"Light.position: wanted finite numbers up to 1e18, got {position.tolist()}")
        if position[3] not in (0.0, 1.0):
            raise InputError(f"Light.position: wanted w = 0 or w = 1, got {position[3]}")
        if position[3] == 0.0 and not position[:3].any():
            raise InputError("Light: a directional light needs a direction that is not zero")
        if (vector(self.color, "Light.color") < 0).any():
            raise InputError(f"Light.color: wanted 3 numbers >= 0, got {shown(self.color)}")
        if number(self.intensity, "Light.intensity") < 0:
            raise InputError(f"Light.intensity: wanted a number >= 0, got {self.intensity}")
        if not 0.0 <= number(self.radius, "Light.radius") <= 1e18:
            raise InputError(f"Light.radius: wanted a number from 0 to 1e18, got {self.radius}")
        if not 0.0 <= number(self.angular_diameter, "Light.angular_diameter") < 180.0:
            raise InputError(
                f"Light.angular_diameter: wanted at least 0 and less than 180, got {self.angular_diameter}"
            )
        if self.radius > 0.0 and position[3] == 0.0:
            raise InputError("Light.radius: a directional light has none; its size is its angular_diameter")
        if self.angular_diameter > 0.0 and position[3] == 1.0:
            raise InputError("Light.angular_diameter: a point light has none; its size is its radius")
        position.flags.writeable = False
        object.__setattr__(self, "position", position)

    @classmethod
    def point(
        cls,
        position: Vector,
        color: tuple[float, float, float] = (1.0, 1.0, 1.0),
        intensity: float = 1.0,
        radius: float = 0.0,
    ) -> "Light":
        """A point light at `position`, three world coordinates; a sphere around it with a `radius`."""
        return cls(np.append(vector(position, "Light.position"), 1.0), color, intensity, radius)

    @classmethod
    def directional(
        cls,
        direction: Vector,
        color: tuple[float, float, float] = (1.0, 1.0, 1.0),
        intensity: float = 1.0,
        angular_diameter: float = 0.0,
    ) -> "Light":
        """Parallel light that travels along `direction` (any length but zero), or a cone of such light around it."""
        position = np.append(-vector(direction, "Light.direction"), 0.0)
        return cls(position, color, intensity, angular_diameter=angular_diameter)

    @classmethod
    def sun(
        cls,
        azimuth: float,
        elevation: float,
        up: Vector = (0.0, 1.0, 0.0),
        north: Vector | None = None,
        color: tuple[float, float, float] = (1.0, 1.0, 1.0),
        intensity: float = 1.0,
        angular_diameter: float = 0.0,
    ) -> "Light":
        """Parallel light from the sun's place in the sky.

        Parameters
        ----------
        azimuth
            Degrees clockwise from north, seen from above.
        elevation
            Degrees above the horizon, -90 to 90.
        up
            World up; y by default.
        north
            World north; by default -z when up is y, +y when up is z. Needed for any other `up`.
        angular_diameter
            Degrees across; 0.53 for the soft edges of real sunlight.
        """
        if not -90.0 <= number(elevation, "Light.sun: elevation") <= 90.0:
            raise InputError(f"Light.sun: wanted an elevation of -90 to 90 degrees, got {elevation}")
        up_axis, north_axis = horizon(up, north)
        east_axis = np.cross(north_axis, up_axis)
        to_north, to_east = _cos_sin(number(azimuth, "Light.sun: azimuth"))
        flat, high = _cos_sin(elevation)
        level = to_north * north_axis + to_east * east_axis
        position = np.append(flat * level + high * up_axis, 0.0)
        return cls(position, color, intensity, angular_diameter=angular_diameter)

    @property
    def is_directional(self) -> bool:
        """Whether the light's rays are parallel (w = 0)."""
        return bool(self.position[3] == 0.0)

    @property
    def is_area(self) -> bool:
        """Whether the light has a size, so that its shadows have soft edges."""
        return self.radius > 0.0 or self.angular_diameter > 0.0


def horizon(up: Vector, north: Vector | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors of up and north; north is made perpendicular to up."""
    up_axis = vector(up, "Light.sun: up")
    length = float(np.linalg.norm(up_axis))
    if length == 0.0:
        raise InputError("Light.sun: wanted an up vector that is not zero")
    up_axis = up_axis / length
    if north is None:
        if np.array_equal(up_axis, (0, 1, 0)):
            north = (0.0, 0.0, -1.0)
        elif np.array_equal(up_axis, (0, 0, 1)):
            north = (0.0, 1.0, 0.0)
        else:
            raise InputError(f"Light.sun: north is needed when up is neither y nor z, got up {up_axis.tolist()}")
    north_axis = vector(north, "Light.sun: north")
    north_axis = north_axis - up_axis * float(north_axis @ up_axis)
    length = float(np.linalg.norm(north_axis))
    if length <= 1e-9 * float(np.linalg.norm(north)):  # what rounding leaves of a parallel vector
        raise InputError("Light.sun: north must not be parallel to up")
    return up_axis, north_axis / length


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine, exact at quarter turns: a sun in the zenith is edge-on to walls, to the last bit."""
    quarters = round(math.fmod(degrees, 360.0) / 90.0)
    rest = math.radians(math.fmod(degrees, 360.0) - 90.0 * quarters)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarters % 4]
