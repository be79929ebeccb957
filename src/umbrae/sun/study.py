"""Hours of direct sun on sensors: one exact shadow mask per position of the sun."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import Vector, instance
from umbrae.clock import Clock
from umbrae.mask import Guarantee
from umbrae.memory import require
from umbrae.methods import Method, cast_shadow, make_method
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.sun.solar import Sky

_BYTES_PER_SENSOR = 80
"""Sensors in order, counts, hours, and what the shadows of one direction take, measured."""


@dataclass(frozen=True, eq=False)
class SunStudy:
    """How long the sun shines on each sensor.

    Attributes
    ----------
    hours
        `(...)` float64, the sensors' shape: hours of direct sun. NaN for a picture's background.
    sky
        Times, place, and where the sun stood.
    guarantee
        What the method promises about the verdict of every sensor at every time.
    """

    hours: NDArray[np.float64]
    sky: Sky
    guarantee: Guarantee

    @property
    def lit(self) -> NDArray[np.float64]:
        """`(...)` hours as a share of those with the sun above the horizon, 0 to 1; 0 where it never rises."""
        return self.hours / (self.sky.possible_hours or 1.0)


def sun_hours(
    scene: Scene,
    sensors: ViewSamples,
    times: Sequence[dt.datetime],
    latitude: float,
    longitude: float,
    *,
    north: float = 0.0,
    up: Vector = (0.0, 1.0, 0.0),
    step: dt.timedelta | None = None,
    method: str | Method = "frustum",
    clock: Clock | None = None,
) -> SunStudy:
    """Count how long the sun shines on each sensor.

    Parameters
    ----------
    sensors
        Samples on surfaces (`surface_sensors`, `ViewSamples.on_surface`), free points, or a picture's (`sample`). A
        surface that is turned away from the sun gets none.
    times, latitude, longitude, north, up, step
        When and where: see `Sky.over`. Nothing is computed for times with the sun below the horizon.
    method
        A name from `METHODS`, or a `Method` with its options set.
    clock
        Hears how long "prepare" and "sun" take, and how many positions of the sun are done.

    Raises
    ------
    InputError
        For anything that cannot be used.
    OptionError
        For an unknown method, or when pvlib is not installed.
    CapacityError
        When the work would not fit into memory.
    """
    sky = Sky.over(times, latitude, longitude, north=north, up=up, step=step)
    return sun_study(scene, sensors, sky, method, clock)


def sun_study(
    scene: Scene, sensors: ViewSamples, sky: Sky, method: str | Method = "frustum", clock: Clock | None = None
) -> SunStudy:
    """`sun_hours` under a sky that is there already."""
    clock = clock or Clock()
    for value, kind, name in ((scene, Scene, "scene"), (sensors, ViewSamples, "sensors"), (sky, Sky, "sky")):
        instance(value, kind, name)
    sensors.check(scene)
    algorithm = make_method(method)
    require(sensors.size * _BYTES_PER_SENSOR, f"a study of {sensors.size:,} points")
    # Lists along a curve in space, whatever order they come in: methods work on neighbours together.
    order = None if sensors.camera is not None else sensors.along_curve
    listed = sensors if order is None else sensors.take(order)
    suns = [light for light, day in zip(sky.lights, sky.is_day, strict=True) if day]
    count = np.zeros(listed.shape, np.min_scalar_type(len(suns)))
    with clock.span("prepare"):
        caster = algorithm.prepare(scene, clock)
    with clock.span("sun"):
        for done, light in enumerate(suns, 1):
            # Without the clock: what should move is how many suns are done.
            count += ~cast_shadow(algorithm, caster, light, listed).in_shadow
            clock.advance(done, len(suns))
    hours = np.empty(sensors.size)
    hours[slice(None) if order is None else order] = count.reshape(-1) * sky.step_hours
    hours = hours.reshape(sensors.shape)
    hours[~sensors.covered] = np.nan
    return SunStudy(hours, sky, algorithm.guarantee)


def sunnier(sensors: ViewSamples, study: SunStudy) -> tuple[ViewSamples, SunStudy]:
    """Of sensors `(2, n)`, such as those of `both_sides`, the one of each pair with more hours, and its hours."""
    second = study.hours[1] > study.hours[0]
    count = len(second)
    chosen = np.arange(count) + np.where(second, count, 0)
    return sensors.take(chosen), replace(study, hours=study.hours.reshape(-1)[chosen])
