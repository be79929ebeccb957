"""Times of a day, and where the sun stands at them."""

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import Vector, instance, number, shown, vector
from umbrae.errors import InputError, OptionError
from umbrae.light import Light

YEARS = range(1000, 3001)
"""Calendar and solar position agree to far below a step in these."""

_SHORTEST_STEP = dt.timedelta(seconds=1)


@dataclass(frozen=True, eq=False)
class Sky:
    """Where the sun stands over a place, time by time; made by `Sky.over`.

    Attributes
    ----------
    times
        `(n,)` with time zones, day and night.
    step_hours
        Hours that each time stands for.
    latitude, longitude, north
        Degrees, as given to `over`.
    azimuth, elevation
        `(n,)` float64 degrees: clockwise from geographic north; above the horizon, as light arrives (with refraction).
    lights
        One directional light per time, in the scene's coordinates.
    """

    times: tuple[dt.datetime, ...]
    step_hours: float
    latitude: float
    longitude: float
    north: float
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    lights: tuple[Light, ...]

    @classmethod
    def over(
        cls,
        times: Sequence[dt.datetime],
        latitude: float,
        longitude: float,
        *,
        north: float = 0.0,
        up: Vector = (0.0, 1.0, 0.0),
        step: dt.timedelta | None = None,
    ) -> "Sky":
        """Where the sun stands at `times`, by the solar position algorithm of NREL (pvlib).

        The elevation is the apparent one: at the horizon, refraction in a standard atmosphere lifts the sun by about
        half a degree, and its light arrives from there.

        Parameters
        ----------
        times
            With time zone; each stands for a step of time around it: see `day_times`.
        latitude, longitude
            Degrees north and east.
        north
            Degrees clockwise, seen from above, from the model's north (-z when y is up, +y when z is up) to geographic
            north. With 90 geographic north lies along +x.
        up
            World up: y (0, 1, 0) or z (0, 0, 1).
        step
            What each time stands for; by default the distance of the times, which must then be equal.

        Raises
        ------
        InputError
            For times without a time zone, or not equally spaced and no step; for a place that does not exist, or an up
            vector other than y or z.
        OptionError
            When pvlib is not installed.
        """
        latitude, longitude = check_place(latitude, longitude)
        up_axis = vector(up, "up")
        if not (np.array_equal(up_axis, (0, 1, 0)) or np.array_equal(up_axis, (0, 0, 1))):
            raise InputError(f"up: wanted y or z, which have a north: (0, 1, 0) or (0, 0, 1), got {shown(up)}")
        turn = math.fmod(number(north, "north"), 360.0)
        asked = tuple(times)
        for one in asked:
            instance(one, dt.datetime, "times")
            if one.utcoffset() is None:
                raise InputError(f"times: wanted times with a time zone, got {one.isoformat()}")
            if one.year not in YEARS:
                raise InputError(f"times: wanted years {YEARS[0]} to {YEARS[-1]}, got {one.year}")
        step_hours = _step(asked, step) / dt.timedelta(hours=1)
        azimuth, elevation = _positions(asked, latitude, longitude)
        lights = tuple(Light.sun(a + turn, e, up) for a, e in zip(azimuth.tolist(), elevation.tolist(), strict=True))
        return cls(asked, step_hours, latitude, longitude, float(north), azimuth, elevation, lights)

    @property
    def is_day(self) -> NDArray[np.bool_]:
        """`(n,)` whether the sun's centre stands above the horizon."""
        above: NDArray[np.bool_] = self.elevation > 0.0
        return above

    @property
    def possible_hours(self) -> float:
        """Hours with the sun above the horizon: what an upward sensor in the open gets."""
        return float(np.count_nonzero(self.is_day)) * self.step_hours


def day_times(
    date: dt.date | str,
    step: dt.timedelta = dt.timedelta(minutes=10),
    timezone: str | dt.tzinfo = "UTC",
) -> list[dt.datetime]:
    """The middles of equal steps from midnight to midnight, local time.

    Each time stands for the step around it, so that their sum is the integral over the day (midpoint rule) and no
    sunrise is counted early or late on average. Where clocks change, the day has 23 or 25 hours.

    Parameters
    ----------
    date
        The day, as a `datetime.date` or as `YYYY-MM-DD`.
    step
        Longest step; shortened until a whole number of them fills the day.
    timezone
        A name of the IANA database such as "Europe/Vienna", or a `tzinfo`.

    Raises
    ------
    InputError
        For a date or a time zone that does not exist, or a step shorter than a second or longer than the day.
    """
    day, zone = _date(date), _zone(timezone)
    instance(step, dt.timedelta, "day_times: step")
    start, end = (
        dt.datetime.combine(one, dt.time(), zone).astimezone(dt.UTC) for one in (day, day + dt.timedelta(days=1))
    )
    if end <= start:
        raise InputError(f"date: {day} does not exist in {timezone}, where the calendar skipped it")
    if not _SHORTEST_STEP <= step <= end - start:
        raise InputError(f"step: wanted one second up to the day's {end - start}, got {step}")
    count = -((start - end) // step)
    return [(start + (end - start) * (2 * index + 1) / (2 * count)).astimezone(zone) for index in range(count)]


def longitude_zone(longitude: float) -> dt.timezone:
    """The zone of whole hours from UTC whose noon is nearest to the sun's on the average."""
    return dt.timezone(dt.timedelta(hours=round(check_place(0.0, longitude)[1] / 15.0)))


def check_place(latitude: float, longitude: float) -> tuple[float, float]:
    """Degrees north and east; an `InputError` when there is no such place."""
    if not -90.0 <= number(latitude, "latitude") <= 90.0:
        raise InputError(f"latitude: wanted -90 to 90 degrees north, got {latitude}")
    if not -180.0 <= number(longitude, "longitude") <= 180.0:
        raise InputError(f"longitude: wanted -180 to 180 degrees east, got {longitude}")
    return float(latitude), float(longitude)


def _step(times: tuple[dt.datetime, ...], step: dt.timedelta | None) -> dt.timedelta:
    if step is not None:
        instance(step, dt.timedelta, "step")
        if step <= dt.timedelta():
            raise InputError(f"step: wanted a time > 0, got {step}")
        return step
    if len(times) < 2:
        raise InputError(f"step: needed with {len(times)} times, to say how long each stands for")
    seconds = np.diff([one.timestamp() for one in times])
    mean = float(seconds.mean())
    if not mean > 0.0 or np.abs(seconds - mean).max() > 0.001:
        raise InputError("step: needed, as the times are not equally spaced one after another")
    return dt.timedelta(seconds=mean)


def _positions(
    times: tuple[dt.datetime, ...], latitude: float, longitude: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        import pandas
        from pvlib.solarposition import spa_python
    except ImportError as error:
        raise OptionError(f"sun positions need pvlib: pip install 'umbrae[sun]' ({error})") from error
    if not times:
        return np.zeros(0), np.zeros(0)
    index = pandas.DatetimeIndex([one.astimezone(dt.UTC) for one in times])
    found = spa_python(index, latitude, longitude)
    return found["azimuth"].to_numpy(), np.clip(found["apparent_elevation"].to_numpy(), -90.0, 90.0)


def _date(date: dt.date | str) -> dt.date:
    if isinstance(date, str):
        try:
            date = dt.date.fromisoformat(date)
        except ValueError as error:
            raise InputError(f"date: wanted a date YYYY-MM-DD that exists, got {shown(date)}") from error
    instance(date, dt.date, "date")
    if date.year not in YEARS:
        raise InputError(f"date: wanted a year from {YEARS[0]} to {YEARS[-1]}, got {date.year}")
    return dt.date(date.year, date.month, date.day)


def _zone(timezone: str | dt.tzinfo) -> dt.tzinfo:
    if isinstance(timezone, dt.tzinfo):
        return timezone
    try:
        return ZoneInfo(timezone)
    except (KeyError, ValueError, OSError, TypeError) as error:
        # A name that is no path, that is not there, or that is a folder of the database.
        raise InputError(
            f"timezone: wanted a name such as Europe/Vienna or UTC, got {shown(timezone)} (not in the zone database)"
        ) from error
