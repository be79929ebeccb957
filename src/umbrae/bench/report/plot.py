"""Plots as SVG that a page holds in itself: colours come from its style sheet, and follow its light or dark mode.

A library would bring its own colours and fonts, and a hundred times the bytes; lines, markers and ticks are all there
is to draw.
"""

import math
from collections.abc import Sequence
from html import escape

from umbrae.bench.report.section import Curve, Plot

WIDTH, HEIGHT = 640, 360
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 20, 38, 64
_SHAPES = {
    "circle": "m-4.2 0a4.2 4.2 0 1 0 8.4 0a4.2 4.2 0 1 0 -8.4 0z",
    "square": "m-3.7 -3.7h7.4v7.4h-7.4z",
    "diamond": "m0 -5.2l5.2 5.2l-5.2 5.2l-5.2 -5.2z",
    "triangle": "m0 -5l5 8.8h-10z",
    "cross": "m-4.8 -1.5h3.3v-3.3h3v3.3h3.3v3h-3.3v3.3h-3v-3.3h-3.3z",
}
_DASHES = ("", "7 3", "2 3", "8 3 2 3")
_COLOURS = 10
"""In the style sheet. Five shapes and a dash for each five curves: no two look the same, in grey neither."""


def svg(plot: Plot) -> str:
    """A plot with its legend; empty where there is nothing to draw."""
    everything = [point for curve in plot.curves for point in curve.points if all(map(math.isfinite, point))]
    if not everything:
        return ""
    axes = [_Axis([point[i] for point in everything]) for i in range(2)]

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x, y = (axis.share(value) for axis, value in zip(axes, point, strict=True))
        return _LEFT + x * (WIDTH - _LEFT - _RIGHT), HEIGHT - _BOTTOM - y * (HEIGHT - _TOP - _BOTTOM)

    parts, legend = _frame(axes, plot), []
    for place_in_plot, curve in enumerate(plot.curves):
        placed = [place(point) for point in curve.points if all(map(math.isfinite, point))]
        number = place_in_plot if curve.number is None else curve.number
        if placed:
            parts.append(_drawn(curve, number, placed, plot.joined))
            key = _drawn(curve, number, [(-18.0, 0.0), (18.0, 0.0)] if plot.joined else [(0.0, 0.0)], plot.joined, True)
            legend.append(f'<li><svg viewBox="-18 -7 36 14" aria-hidden="true">{key}</svg>{escape(curve.name)}</li>')
    title = escape(plot.title)
    return (
        f'<figure><figcaption>{title}</figcaption><svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{title}">{"".join(parts)}</svg><ul class="legend">{"".join(legend)}</ul></figure>'
    )


def _drawn(curve: Curve, number: int, points: Sequence[tuple[float, float]], joined: bool, key: bool = False) -> str:
    """A curve's line and markers; as a key, one marker amid the line."""
    look = f"c{number % _COLOURS}{' hollow' if curve.hollow else ''}"
    dash = _DASHES[number // len(_SHAPES) % len(_DASHES)]
    style = f' stroke-dasharray="{dash}"' if dash else ""
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    parts = [f'<polyline class="line"{style} points="{line}"/>'] if joined and len(points) > 1 else []
    shape = list(_SHAPES.values())[number % len(_SHAPES)]
    for x, y in [(0.0, 0.0)] if key else points:
        parts.append(f'<path class="mark" d="M{x:.1f} {y:.1f}{shape}"/>')
    return f'<g class="{look}">{"".join(parts)}</g>'


class _Axis:
    """From values to shares of the way along an axis: logarithmic where they span a decade, else from 0."""

    def __init__(self, values: Sequence[float]) -> None:
        low, high = min(values), max(values)
        self._log = low > 0 and high >= 10 * low
        if self._log:
            self._low, self._high = low / 1.15, high * 1.15
        else:
            low = min(low, 0.0)
            self._low, self._high = low, high + 0.05 * ((high - low) or 1.0)

    def share(self, value: float) -> float:
        """0 at the lower end, 1 at the upper."""
        if self._log:
            return math.log(value / self._low) / math.log(self._high / self._low)
        return (value - self._low) / (self._high - self._low)

    def ticks(self) -> list[float]:
        """Round values within, six or so."""
        if not self._log:
            step = 10.0 ** math.floor(math.log10((self._high - self._low) / 4))
            step *= next(factor for factor in (1, 2, 5, 10) if (self._high - self._low) / (step * factor) <= 6)
            return [k * step for k in range(math.ceil(self._low / step), math.floor(self._high / step) + 1)]
        first, last = math.floor(math.log10(self._low)), math.ceil(math.log10(self._high))
        found: list[float] = []
        for steps, every in (((1, 2, 5), 1), ((1, 3), 1), ((1,), 1), ((1,), 2), ((1,), 3)):
            found = [step * 10.0**power for power in range(first, last + 1, every) for step in steps]
            found = [value for value in found if self._low <= value <= self._high]
            if len(found) <= 7:
                break
        return found


def _frame(axes: Sequence[_Axis], plot: Plot) -> list[str]:
    """Grid lines, numbers and names of both axes."""
    bottom, right = HEIGHT - _BOTTOM, WIDTH - _RIGHT
    parts = [f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>']
    for value in axes[0].ticks():
        x = _LEFT + axes[0].share(value) * (right - _LEFT)
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{bottom}"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 24}" text-anchor="middle">{_number(value)}</text>')
    for value in axes[1].ticks():
        y = bottom - axes[1].share(value) * (bottom - _TOP)
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 5:.1f}" text-anchor="end">{_number(value)}</text>')
    parts.append(
        f'<text class="name" x="{(_LEFT + right) / 2}" y="{HEIGHT - 12}" text-anchor="middle">{escape(plot.x)}</text>'
    )
    # Not turned: that would take the width of a phone, and a turned head.
    parts.append(f'<text class="name" x="10" y="24">{escape(plot.y)}</text>')
    return parts


def _number(value: float) -> str:
    if value == 0:
        return "0"
    for size, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"
