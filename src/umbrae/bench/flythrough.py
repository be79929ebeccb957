"""Fly-throughs: key frames of a camera in a CSV file, joined by Catmull-Rom splines."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.errors import InputError
from umbrae.files import load_text

COLUMNS = ("time", "x", "y", "z", "view_x", "view_y", "view_z", "up_x", "up_y", "up_z")
Place = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FlyThrough:
    """Key frames of a camera; made by `FlyThrough.load` or `FlyThrough.between`.

    Attributes
    ----------
    name
        For messages: the name of the file.
    time
        `(n,)` float64 seconds, growing; two or more.
    keys
        `(n, 9)` float64: position in the scene's coordinates, direction of view, and up, one row for each key.
    """

    name: str
    time: NDArray[np.float64]
    keys: NDArray[np.float64]

    def __post_init__(self) -> None:
        if len(self.time) < 2:
            raise InputError(f"{self.name}: wanted two or more key frames, got {len(self.time)}")
        back = np.flatnonzero(np.diff(self.time) <= 0)
        if len(back):
            early, late = self.time[back[0]], self.time[back[0] + 1]
            raise InputError(f"{self.name}: wanted times that grow, got {late:g} after {early:g}")
        for name, start in (("view", 3), ("up", 6)):
            zero = np.flatnonzero(~self.keys[:, start : start + 3].any(axis=1))
            if len(zero):
                raise InputError(f"{self.name}: the {name} direction at time {self.time[zero[0]]:g} is zero")

    @classmethod
    def load(cls, path: Path) -> "FlyThrough":
        """Read a CSV file whose first line names its columns: `COLUMNS`, in any order.

        Raises
        ------
        InputError
            For a file that cannot be read, other columns, anything but finite numbers, fewer than two key frames,
            times that do not grow, or a direction of zero.
        """
        # What a spreadsheet writes may start with a byte order mark.
        text = load_text(path).removeprefix("\ufeff")
        try:
            rows = [row for row in csv.reader(text.splitlines()) if any(row)]
        except csv.Error as error:
            raise InputError(f"{path}: no CSV: {error}") from error
        header = [name.strip() for name in rows[0]] if rows else []
        if sorted(header) != sorted(COLUMNS):
            raise InputError(f"{path}: wanted the columns {','.join(COLUMNS)}, got {','.join(header)[:120] or 'none'}")
        order = [header.index(name) for name in COLUMNS]
        values = np.array([_numbers(path, number, row) for number, row in enumerate(rows[1:], 1)])
        values = values.reshape(-1, len(COLUMNS))[:, order]
        return cls(path.name, values[:, 0], values[:, 1:])

    @classmethod
    def between(cls, name: str, seconds: float, places: Sequence[tuple[Place, Place]]) -> "FlyThrough":
        """Through places at equal distances of time: where the camera is, and what it looks at; y is up."""
        eyes, targets = np.array(places, np.float64).swapaxes(0, 1)
        up = np.tile((0.0, 1.0, 0.0), (len(eyes), 1))
        return cls(name, np.linspace(0.0, seconds, len(eyes)), np.hstack([eyes, targets - eyes, up]))

    def at(self, time: float) -> NDArray[np.float64]:
        """`(9,)` position, direction of view and up at a time in seconds; the first or last key outside.

        A cubic Hermite spline whose slope at a key is that between its two neighbours: Catmull and Rom's for keys
        at equal distances of time.
        """
        t, keys = self.time, self.keys
        slope = np.concatenate(
            [
                [(keys[1] - keys[0]) / (t[1] - t[0])],
                (keys[2:] - keys[:-2]) / (t[2:] - t[:-2])[:, None],
                [(keys[-1] - keys[-2]) / (t[-1] - t[-2])],
            ]
        )
        i = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 2))
        length = t[i + 1] - t[i]
        s = float(np.clip((time - t[i]) / length, 0.0, 1.0))
        value: NDArray[np.float64] = (
            (2 * s**3 - 3 * s**2 + 1) * keys[i]
            + (s**3 - 2 * s**2 + s) * length * slope[i]
            + (3 * s**2 - 2 * s**3) * keys[i + 1]
            + (s**3 - s**2) * length * slope[i + 1]
        )
        return value

    def cameras(self, frames: int, width: int, height: int, near: float) -> list[Camera]:
        """So many cameras, spread evenly over the flight; the one in its middle if it is one only."""
        shares = np.linspace(0.0, 1.0, frames) if frames > 1 else [0.5]
        return [self.camera(float(share), width, height, near) for share in shares]

    def camera(self, share: float, width: int, height: int, near: float) -> Camera:
        """The camera after a share, 0 to 1, of the whole flight."""
        time = float(self.time[0] + share * (self.time[-1] - self.time[0]))
        position, view, up = self.at(time).reshape(3, 3)
        if not (view.any() and up.any()):
            raise InputError(f"{self.name}: view or up turns through zero at time {time:g}: add a key frame before it")
        return Camera.look_at(position, position + view, up, width=width, height=height, near=near)


def _numbers(path: Path, number: int, row: list[str]) -> list[float]:
    try:
        values = [float(text) for text in row]
    except ValueError:
        values = []
    if len(values) != len(COLUMNS) or not np.isfinite(values).all():
        raise InputError(
            f"{path}: key frame {number}: wanted {len(COLUMNS)} finite numbers, got {','.join(row)[:80]!r}"
        )
    return values
