"""The truth: exact rationals where floating point is unsure."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry import bvh
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.method import Caster, Method
from umbrae.methods.oracle_filter import decide_chunk, margin_chunk
from umbrae.methods.oracle_transmission import Product
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import SOLID, transmission_of

_CHUNK = 4096

_ROOM = 1 << 14
"""Pairs of sample and triangle that a thread holds at a time; in larger scenes as many as there are triangles."""


@dataclass(frozen=True)
class Oracle(Method):
    """Every sample asks the triangles one by one; a floating-point filter first, rationals where it is unsure.

    The definition is the one of `geometry.predicates`, written a second time so that neither can hide the other's
    mistakes: determinants are formed around the sample instead of around a vertex (`oracle_filter`), and exact signs
    come from `fractions.Fraction`. A conservative box tree (`tree = True`) leaves out triangles that the segment from
    the sample to the light cannot meet; `tree = False` asks all of them.

    Where casters let light through, all of them are collected and their shares multiplied up in float64
    (`oracle_transmission`); `OracleCaster.decide` also says between what the result lies.
    """

    tree: bool = True

    name: ClassVar[str] = "oracle"
    paper: ClassVar[str] = "the definition itself"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points", "transparency")

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "OracleCaster":
        return OracleCaster(scene, self.tree)


class Decided(NamedTuple):
    """A mask, and `(..., 3) float32` between what its shares of light lie; None where all casters are solid.

    The two differ where a texture or vertex colours decide and float64 cannot say more: by about 1e-12, or by the whole
    share of a triangle where alpha is that near to the cut-off of alpha mode MASK.
    """

    mask: ShadowMask
    lowest: NDArray[np.float32] | None
    highest: NDArray[np.float32] | None


class OracleCaster(Caster):
    """A scene with its box tree."""

    def __init__(self, scene: Scene, tree: bool = True) -> None:
        self.scene = scene
        self.transmission = transmission_of(scene)
        table = self.transmission
        self.kind = table.kind if table is not None else np.full(len(scene.triangles), SOLID, np.uint8)
        self.closed = self.kind == SOLID
        if table is not None:
            self.closed |= table.closed[table.material_id]
        self._pruned = tree
        self._place(scene, None)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene = scene
        self.tree = bvh.build(scene.positions, scene.triangles)
        if not self._pruned:
            self.tree.lower[:] = -np.inf
            self.tree.upper[:] = np.inf

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        return self.decide(light, samples, clock).mask

    def decide(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> Decided:
        """The mask of `shadow`, and how well its shares of light are known."""
        self.check(light, samples)
        clock = clock or Clock()
        flat = samples.take(np.flatnonzero(samples.covered.reshape(-1)))
        verdict = np.zeros(flat.size, np.int8)
        product = None if self.transmission is None else Product(self.scene, self.kind, light, flat)
        with clock.span("oracle"):
            unsure = self._filter(light, flat, verdict, product, clock) if len(self.scene.triangles) else []
        with clock.span("rationals"):
            asked = 0
            exact = Exact(self.scene, light)
            for pairs in unsure:
                through = []
                for sample, triangle in pairs.tolist():
                    if verdict[sample] == 0:
                        asked += 1
                        if exact.shades(flat, sample, triangle, bool(self.closed[triangle])):
                            if self.kind[triangle] == SOLID:
                                verdict[sample] = 1
                            else:
                                through.append((sample, triangle))
                if product is not None:
                    product.multiply(np.array(through, np.int64).reshape(-1, 2))
        stats = {"predicate_fallbacks": asked}
        dark = verdict != 0
        if product is None:
            return Decided(ShadowMask(_spread(samples, dark, False), Guarantee.EXACT, stats=stats), None, None)
        for left in product.left:
            left[dark] = 0.0
        partial, lowest, highest = (_spread(samples, left.astype(np.float32), 1) for left in product.left)
        # Background is lit.
        in_shadow = (partial == 0).all(axis=-1)
        return Decided(ShadowMask(in_shadow, Guarantee.EXACT, stats=stats, partial=partial), lowest, highest)

    def _filter(
        self,
        light: Light,
        samples: ViewSamples,
        verdict: NDArray[np.int8],
        product: Product | None,
        clock: Clock,
    ) -> list[NDArray[np.int64]]:
        """Write verdicts and take the shares of sure casters; returns `(n, 2)` pairs that are left to rationals."""
        source = light.position.astype(np.float64)
        room = max(_ROOM, len(self.scene.triangles))

        def task(chunk: int) -> list[NDArray[np.int64]]:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, samples.size)
            unsure = []
            pairs = np.empty((room, 3), np.int64)
            while start < stop:
                found, start = decide_chunk(*self._arrays(), source, *_raw(samples), start, stop, verdict, pairs)
                sure = pairs[:found, 2] != 0
                unsure.append(pairs[:found][~sure, :2])
                if product is not None:
                    product.multiply(pairs[:found][sure, :2])
            return unsure

        return [pairs for chunk in run(task, -(-samples.size // _CHUNK), clock) for pairs in chunk]

    def margin(
        self, light: Light, samples: ViewSamples, in_shadow: NDArray[np.bool_], clock: Clock | None = None
    ) -> NDArray[np.float32]:
        """`(...) float32` world units: a lower bound of how far each sample must move before its verdict changes.

        Lit samples: the distance to the nearest shadow frustum. Samples in shadow: the depth inside the frustum that
        holds them deepest. Where casters let light through, those are solid ones; all other samples have the distance
        to the nearest side of any frustum, so that within it the casters are the same, though not what a texture lets
        through. Never more than a hundredth of the scene's extent, where looking further is not worth it; so too for
        background and samples that their own triangle shades.
        """
        low, high = self.scene.bounds.astype(np.float64)
        cap = float(np.linalg.norm(high - low)) / 100.0
        margins = np.full(samples.size, cap)
        flat = samples.take(np.arange(samples.size))
        shaded = np.ascontiguousarray(in_shadow.reshape(-1))
        source = light.position.astype(np.float64)

        def task(chunk: int) -> None:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, flat.size)
            margin_chunk(*self._arrays(), source, *_raw(flat), start, stop, flat.covered, shaded, margins)

        if len(self.scene.triangles):
            run(task, -(-flat.size // _CHUNK), clock)
        # One step down: rounding to float32, and in float64 before it, must not make a margin larger.
        rounded = np.nextafter(margins.astype(np.float32), np.float32(0))
        return rounded.reshape(samples.shape)

    def _arrays(self) -> tuple[Any, ...]:
        return (self.scene.positions, self.scene.triangles, *self.tree, self.kind)


def _spread(samples: ViewSamples, values: NDArray[Any], background: Any) -> NDArray[Any]:
    """What covered samples have, in the shape of all; the others get `background`."""
    covered = samples.covered.reshape(-1)
    result = np.full((samples.size, *values.shape[1:]), background, values.dtype)
    result[covered] = values
    return result.reshape(*samples.shape, *values.shape[1:])


def _raw(samples: ViewSamples) -> tuple[Any, ...]:
    return samples.triangle, samples.barycentric, samples.side, samples.position


Vector = tuple[Fraction, Fraction, Fraction]


class Exact:
    """The definition in rational numbers, one sample and one triangle at a time."""

    def __init__(self, scene: Scene, light: Light) -> None:
        self.scene = scene
        *direction, self.w = (Fraction(float(x)) for x in light.position)
        self.light: Vector = (direction[0], direction[1], direction[2])

    def corners(self, triangle: int) -> tuple[Vector, Vector, Vector]:
        """The triangle's vertices."""
        a, b, c = (_vector(self.scene.positions[i]) for i in self.scene.triangles[triangle])
        return a, b, c

    def facing(self, triangle: int) -> int:
        """The side of the triangle's plane that the light is on; 0 in the plane, or no area."""
        a, b, c = self.corners(triangle)
        return _sign(_dot(_cross(_minus(b, a), _minus(c, a)), _minus(self.light, _times(self.w, a))))

    def shades(self, samples: ViewSamples, sample: int, triangle: int, closed: bool = True) -> bool:
        """Whether the triangle shadows sample number `sample` of a flat list.

        Side planes belong to the triangle if `closed`; else a sample on one counts as moved by (e, e**2, e**3), e -> 0.
        """
        own, side = int(samples.triangle[sample]), int(samples.side[sample])
        facing = self.facing(triangle)
        if triangle == own:
            return side * facing < 0
        if facing == 0:
            return False
        point, offset = _vector(samples.position[sample]), (Fraction(0), Fraction(0), Fraction(0))
        if own >= 0:
            u, v = (Fraction(float(x)) for x in samples.barycentric[sample])
            a, b, c = self.corners(own)
            ab, ac = _minus(b, a), _minus(c, a)
            point = _plus(a, _plus(_times(u, ab), _times(v, ac)))
            offset = _times(Fraction(side), _cross(ab, ac))

        def side_of(normal: Vector, base: Vector) -> int:
            return _sign(_dot(normal, _minus(point, base))) or _sign(_dot(normal, offset))

        a, b, c = self.corners(triangle)
        for first, second in ((a, b), (b, c), (c, a)):
            normal = _cross(_minus(_times(self.w, first), self.light), _minus(second, first))
            sign = side_of(normal, first)
            if sign == 0 and not closed:
                sign = next((_sign(component) for component in normal if component), 0)
            if -facing * sign < 0:
                return False
        return -facing * side_of(_cross(_minus(b, a), _minus(c, a)), a) > 0


def _vector(values: NDArray[np.float32]) -> Vector:
    x, y, z = (Fraction(float(value)) for value in values)
    return x, y, z


def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _times(factor: Fraction, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def _dot(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sign(value: Fraction) -> int:
    return (value > 0) - (value < 0)
