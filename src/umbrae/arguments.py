"""What the command line's texts mean: vectors, sizes and suns, and the cameras and lights made of them."""

import datetime as dt
import enum
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
import typer

from umbrae.camera import Camera
from umbrae.errors import OptionError
from umbrae.light import Light
from umbrae.render import default_sun
from umbrae.scene import Scene

Number = TypeVar("Number", int, float)


class Vector(NamedTuple):
    """`x,y,z`."""

    x: float
    y: float
    z: float


class Size(NamedTuple):
    """`WIDTHxHEIGHT` of a picture, or the two counts of a grid."""

    width: int
    height: int


class Sun(NamedTuple):
    """`azimuth,elevation` in degrees."""

    azimuth: float
    elevation: float


class Side(enum.StrEnum):
    """Of a face: the one with more sun, the one its corners turn counter-clockwise to, or the other."""

    SUNNIER = "sunnier"
    FRONT = "front"
    BACK = "back"


def vector(text: str) -> Vector:
    """Three finite numbers `x,y,z`."""
    return Vector(*_numbers(text, ",", "three numbers x,y,z", 3, float))


def size(text: str) -> Size:
    """Two whole numbers `AxB`, both at least 1."""
    numbers = _numbers(text, "x", "two whole numbers such as 1920x1080", 2, int)
    if min(numbers) < 1:
        raise typer.BadParameter(f"wanted two whole numbers of at least 1, got {text!r}")
    return Size(*numbers)


def sun(text: str) -> Sun:
    """Two finite numbers `azimuth,elevation`."""
    return Sun(*_numbers(text, ",", "two numbers azimuth,elevation in degrees", 2, float))


def up_vector(text: str) -> Vector:
    """World up: `y`, `z`, or `x,y,z` that is not zero."""
    axes = {"y": Vector(0.0, 1.0, 0.0), "z": Vector(0.0, 0.0, 1.0)}
    up = axes.get(text) or Vector(*_numbers(text, ",", "y, z or three numbers x,y,z", 3, float))
    if not any(up):
        raise typer.BadParameter(f"wanted a vector that is not zero, got {text!r}")
    return up


def duration(text: str) -> dt.timedelta:
    """A number with the unit `s`, `min` or `h`."""
    found = re.fullmatch(r"(\d{1,6}(?:\.\d{1,6})?) ?(s|min|h)", text)
    if not found or not float(found[1]):
        raise typer.BadParameter(f"wanted a time > 0 such as 10min, 30s or 1h, got {text!r}")
    return dt.timedelta(seconds=float(found[1]) * {"s": 1, "min": 60, "h": 3600}[found[2]])


def camera(scene: Scene, size: Size, eye: Vector | None, target: Vector | None, up: Vector, fov: float) -> Camera:
    """A camera at `eye` that looks at `target`, both in the file's own coordinates.

    Without both it frames the scene by itself. With a target alone it keeps that direction and distance.
    With an eye alone it looks at the centre of the bounds.
    """
    framed = Camera.frame(scene, up, fov, *size)
    if eye is None and target is None:
        return framed
    center = scene.bounds.astype(np.float64).mean(axis=0)
    look_at = center if target is None else scene.local(target)
    if eye is None:
        forward = framed.axes[2]
        stand = look_at - forward * float(forward @ (center - framed.eye))
    else:
        stand = scene.local(eye)
    return Camera.look_at(stand, look_at, up, fov, *size)


def lights(
    scene: Scene,
    view: Camera,
    points: Sequence[Vector],
    suns: Sequence[Sun],
    up: Vector,
    radius: float = 0.0,
    diameter: float = 0.0,
) -> list[Light]:
    """Point lights in the file's own coordinates, then suns; without any, the default sun.

    `radius` is that of all point lights, `diameter` that of all suns in degrees.

    Raises
    ------
    OptionError
        For a radius without a point light, or a diameter without a sun.
    """
    if radius and not points:
        raise OptionError("--light-radius: wanted a point light (--light); a sun has a --sun-diameter")
    if diameter and points and not suns:
        raise OptionError("--sun-diameter: wanted a sun (--sun); a point light has a --light-radius")
    made = [Light.point(scene.local(point), radius=radius) for point in points]
    made += [Light.sun(azimuth, elevation, up, angular_diameter=diameter) for azimuth, elevation in suns]
    return made or [replace(default_sun(view, up), angular_diameter=diameter)]


def check_light_samples(count: int | None, radius: float, diameter: float) -> None:
    """Refuse a number of light samples where no light has a size."""
    if count is not None and not (radius > 0 or diameter > 0):
        raise OptionError("--light-samples: wanted a light with a size (--light-radius, --sun-diameter)")


def _numbers(text: str, separator: str, wanted: str, count: int, number: Callable[[str], Number]) -> list[Number]:
    try:
        values = [number(part) for part in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise typer.BadParameter(f"wanted {wanted}, got {text!r}")
    return values
