"""The strip below a sun map: what, when, where, and which colour stands for how many hours."""

import datetime as dt

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from umbrae.sun.colors import colors
from umbrae.sun.solar import Sky

BACKGROUND = (246, 245, 242)
# Not those of the C library, which depend on the locale.
_MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)
_INK, _FAINT = (38, 40, 46), (98, 101, 110)


def legend_height(width: int) -> int:
    """Pixels that the legend of a picture takes below it."""
    return max(40, round(width * 0.065))


def legend(width: int, sky: Sky) -> NDArray[np.uint8]:
    """`(legend_height(width), width, 3)` sRGB."""
    height = legend_height(width)
    strip = PillowImage.new("RGB", (width, height), BACKGROUND)
    draw = ImageDraw.Draw(strip)
    margin = round(height * 0.28)
    middle = width // 2
    room = middle - 2 * margin
    title = _font("Direct sun hours", height * 0.32, room)
    below = _font(subtitle(sky), height * 0.21, room)
    draw.text((margin, height * 0.40), "Direct sun hours", _INK, title, anchor="ls")
    draw.text((margin, height * 0.74), subtitle(sky), _FAINT, below, anchor="ls")

    left, right, top, bottom = middle + margin, width - 2 * margin, round(height * 0.22), round(height * 0.46)
    most = sky.possible_hours
    ramp = colors(np.linspace(0, most, max(2, right - left)), most)
    bar = np.broadcast_to(np.round(ramp * 255).astype(np.uint8), (bottom - top, len(ramp), 3))
    strip.paste(PillowImage.fromarray(np.ascontiguousarray(bar)), (left, top))
    font = _font("00 h", height * 0.21, room)
    for hours in ticks(most):
        x = left + (right - 1 - left) * hours / (most or 1.0)
        draw.line((x, bottom, x, bottom + height * 0.06), _INK, max(1, height // 60))
        label = f"{hours:g}" if hours < most else f"{round(hours, 1):g} h"
        draw.text((x, height * 0.74), label, _INK, font, anchor="ms")
    return np.asarray(strip)


def ticks(most: float) -> list[float]:
    """Round hours from 0, and the most there are at the end."""
    step = next((step for step in (0.25, 0.5, 1, 2) if most / step <= 6), 3)
    return [*np.arange(0, max(most - 0.6 * step, 0.1 * step), step).tolist(), most] if most > 0 else [0.0]


def subtitle(sky: Sky) -> str:
    """Day and place: "21 June 2026, 48.30° N 14.30° E"."""
    days = sorted({one.date() for one in sky.times})
    when = " to ".join(_day(day) for day in dict.fromkeys((days[0], days[-1]))) if days else "never"
    north = f"{abs(sky.latitude):.2f}° {'N' if sky.latitude >= 0 else 'S'}"
    east = f"{abs(sky.longitude):.2f}° {'E' if sky.longitude >= 0 else 'W'}"
    return f"{when}, {north} {east}"


def _day(day: dt.date) -> str:
    return f"{day.day} {_MONTHS[day.month - 1]} {day.year}"


def _font(text: str, size: float, room: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font, as large as wanted, or smaller so that the text fits into the room."""
    font = ImageFont.load_default(size)
    width = font.getlength(text)
    return font if width <= room else ImageFont.load_default(max(1.0, size * room / width))
