"""Plots as SVG that a page holds in itself: colours come from its style sheet, and follow its light or dark mode.

A library would bring its own colours and fonts, and a hundred times the bytes; lines, markers and ticks are all there
is to draw.
"""

import math
from collections.abc import Sequence
from html import escape

from umbrae.bench.report.section import Plot

WIDTH, HEIGHT = 640, 340
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 12, 12, 46
_MARKERS = ("circle", "square", "diamond", "triangle", "cross")
_DASHES = ("", "6 3", "2 3", "8 3 2 3")
_MOST = 10


def svg(plot: Plot) -> str:
    """A plot with its legend; empty where there is nothing to draw."""
    curves = [(curve.name, _drawable(curve.points, plot.logarithmic)) for curve in plot.curves]
    curves = [(name, points) for name, points in curves if points]
    if not curves:
        return ""
    everything = [point for _, points in curves for point in points]
    axes = [_Axis([point[i] for point in everything], plot.logarithmic[i]) for i in range(2)]

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x, y = (axis.share(value) for axis, value in zip(axes, point, strict=True))
        return _LEFT + x * (WIDTH - _LEFT - _RIGHT), HEIGHT - _BOTTOM - y * (HEIGHT - _TOP - _BOTTOM)

    parts = [*_frame(axes, plot)]
    for number, (_, points) in enumerate(curves):
        placed = [place(point) for point in points]
        dash = _DASHES[number // _MOST % len(_DASHES)]
        style = f' stroke-dasharray="{dash}"' if dash else ""
        if plot.joined:
            line = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
            parts.append(f'<polyline class="line c{number % _MOST}"{style} points="{line}"/>')
        parts += [_marker(number, x, y) for x, y in placed]
    legend = "".join(
        f'<li><svg viewBox="-7 -7 14 14" aria-hidden="true">{_marker(number, 0, 0)}</svg>{escape(name)}</li>'
        for number, (name, _) in enumerate(curves)
    )
    return (
        f'<figure><figcaption>{escape(plot.title)}</figcaption><svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'role="img" aria-label="{escape(plot.title)}">{"".join(parts)}</svg><ul class="legend">{legend}</ul></figure>'
    )


def _drawable(points: Sequence[tuple[float, float]], logarithmic: tuple[bool, bool]) -> list[tuple[float, float]]:
    return [
        point
        for point in points
        if all(math.isfinite(value) and (value > 0 or not log) for value, log in zip(point, logarithmic, strict=True))
    ]


class _Axis:
    """From values to shares of the way along an axis."""

    def __init__(self, values: Sequence[float], logarithmic: bool) -> None:
        self._log = logarithmic
        low, high = min(values), max(values)
        if logarithmic:
            low, high = low / 1.15, high * 1.15
        else:
            low, high = min(low, 0.0), high + 0.05 * ((high - min(low, 0.0)) or 1.0)
        self._low, self._high = low, high

    def share(self, value: float) -> float:
        """0 at the lower end, 1 at the upper."""
        if self._log:
            return math.log(value / self._low) / math.log(self._high / self._low)
        return (value - self._low) / (self._high - self._low)

    def ticks(self) -> list[float]:
        """Round values within, five or so."""
        if not self._log:
            step = 10.0 ** math.floor(math.log10((self._high - self._low) / 4))
            step *= next(factor for factor in (1, 2, 5, 10) if (self._high - self._low) / (step * factor) <= 6)
            return [k * step for k in range(math.ceil(self._low / step), math.floor(self._high / step) + 1)]
        first, last = math.floor(math.log10(self._low)), math.ceil(math.log10(self._high))
        for steps in ((1, 2, 5), (1, 3), (1,)):
            found = [step * 10.0**power for power in range(first, last + 1) for step in steps]
            found = [value for value in found if self._low <= value <= self._high]
            if len(found) <= 8 or steps == (1,):
                return found
        return []


def _frame(axes: Sequence[_Axis], plot: Plot) -> list[str]:
    """Grid lines, numbers and names of both axes."""
    bottom, right = HEIGHT - _BOTTOM, WIDTH - _RIGHT
    parts = [f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>']
    for value in axes[0].ticks():
        x = _LEFT + axes[0].share(value) * (right - _LEFT)
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{bottom}"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{_number(value)}</text>')
    for value in axes[1].ticks():
        y = bottom - axes[1].share(value) * (bottom - _TOP)
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{_number(value)}</text>')
    middle = (_TOP + bottom) / 2
    parts.append(
        f'<text class="name" x="{(_LEFT + right) / 2}" y="{HEIGHT - 8}" text-anchor="middle">{escape(plot.x)}</text>'
    )
    turned = f'transform="translate(14 {middle}) rotate(-90)" text-anchor="middle"'
    parts.append(f'<text class="name" {turned}>{escape(plot.y)}</text>')
    return parts


def _number(value: float) -> str:
    if value == 0:
        return "0"
    for size, unit in ((1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"


def _marker(number: int, x: float, y: float) -> str:
    """One of five shapes in one of ten colours."""
    colour = f"mark c{number % _MOST}"
    shape = _MARKERS[number % len(_MARKERS)]
    if shape == "circle":
        return f'<circle class="{colour}" cx="{x:.1f}" cy="{y:.1f}" r="4"/>'
    path = {
        "square": "m-3.6 -3.6h7.2v7.2h-7.2z",
        "diamond": "m0 -5l5 5l-5 5l-5 -5z",
        "triangle": "m0 -5l4.8 8.6h-9.6z",
        "cross": "m-4.5 -1.3h3.2v-3.2h2.6v3.2h3.2v2.6h-3.2v3.2h-2.6v-3.2h-3.2z",
    }[shape]
    return f'<path class="{colour}" d="M{x:.1f} {y:.1f}{path}"/>'
