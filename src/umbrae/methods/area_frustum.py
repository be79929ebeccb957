"""The frustum method under a light with a size: all light samples in one go (see `area_traversal`)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.chance import LIGHT, key_of
from umbrae.geometry.solids import Solids
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.area_leaves import COUNTERS, write_shares
from umbrae.methods.area_pairs import MOST
from umbrae.methods.area_samples import LightDisc, light_disc
from umbrae.methods.area_setup import cluster_tree, disc_sides
from umbrae.methods.area_transmission import AreaDimming, full_light, write_arriving
from umbrae.methods.area_traversal import shade_node
from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import POSITION_ERROR, light_frames, surface_error
from umbrae.methods.sample_tree import bounds_with, build
from umbrae.methods.transmission_buffer import TOLERANCE, Dice
from umbrae.methods.triangle_clusters import TriangleClusters
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import SOLID, Transmission

BLOCK = 1 << 23
"""Samples per hierarchy, to bound the memory."""

_SAMPLES_PER_TASK = 1 << 16


def check_light_samples(count: int) -> None:
    """Refuse more light samples than a view sample has bits for."""
    if not 1 <= whole(count, "frustum: light_samples") <= MOST:
        raise OptionError(f"frustum: wanted 1 to {MOST} light samples, got {count}")


class Casters(NamedTuple):
    """What stands in the way of the light: solid triangles, with their solids if wanted, and others.

    `bounds (2, 3)` of all; `table` is None where all triangles are solid, `sheer` where no other one lets only a part
    of the light through.
    """

    scene: Scene
    bounds: NDArray[np.float64]
    solid: TriangleClusters
    solids: Solids | None
    table: Transmission | None
    sheer: TriangleClusters | None


class Found(NamedTuple):
    """What becomes of view samples.

    `bits (n,)`: bit i is set where light sample i is hidden by solid triangles, or dark behind others; those beyond the
    last one are set as well, so that a view sample is dark where all 64 are. `in_shadow (n,)`; `shares (n, 3)` of the
    light that arrive.
    """

    bits: NDArray[np.int64]
    in_shadow: NDArray[np.bool_]
    shares: NDArray[np.float32]


def shadow_of_area(
    casters: Casters, light: Light, samples: ViewSamples, count: int, seed: int | None, clock: Clock
) -> ShadowMask:
    """What arrives of a light with a size: `count` light samples for each view sample, each decided exactly.

    With a `seed`, chance decides which of them triangles stop that let a part of the light through.
    """
    found, stats = find(casters, light, samples, count, seed, clock)
    chance = casters.sheer is not None and seed is not None
    return ShadowMask(
        found.in_shadow.reshape(samples.shape),
        Guarantee.NONE if chance else Guarantee.EXACT,
        stats={**dict(zip(COUNTERS, (int(n) for n in stats), strict=True)), "light_samples": count},
        partial=found.shares.reshape(*samples.shape, 3),
        tolerance=0.0 if casters.sheer is None or chance else TOLERANCE,
    )


def find(
    casters: Casters, light: Light, samples: ViewSamples, count: int, seed: int | None, clock: Clock
) -> tuple[Found, NDArray[np.int64]]:
    """What becomes of all samples, and the counters; parameters are those of `shadow_of_area`."""
    scene, table = casters.scene, casters.table
    found = Found(
        np.full(samples.size, -1 << count if count < MOST else 0, np.int64),
        np.empty(samples.size, bool),
        np.empty((samples.size, 3), np.float32),
    )
    stats = np.zeros(len(COUNTERS), np.int64)
    if not len(scene.triangles) or not samples.size:
        found.in_shadow[:], found.shares[:] = False, 1.0
        return found, stats
    disc = light_disc(light, count, samples.shape)
    own_side, sheer = np.zeros(len(scene.triangles), np.int8), np.zeros((0, LANES), np.int8)
    with clock.span("facing"):
        solid = disc_sides(scene, casters.solid, disc, own_side, clock)
        if casters.sheer is not None:
            sheer = disc_sides(scene, casters.sheer, disc, own_side, clock)
        if casters.solids is not None:
            _cull(casters.solids, disc, casters.solid.order, solid)
    casts = np.ones(len(own_side), bool) if table is None else table.kind == SOLID
    sides = _Sides(own_side, casts, solid, sheer)
    key = None if seed is None else key_of(seed, LIGHT, light.position)
    width = samples.size // samples.shape[0]
    step = max(4, BLOCK // width // 4 * 4)
    for start in range(0, samples.shape[0], step):
        block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
        these = slice(start * width, (start + step) * width)
        part = Found(found.bits[these], found.in_shadow[these], found.shares[these])
        stats += _shadow_block(casters, disc, block, start * width, sides, key, part, clock)
    return found, stats


class _Sides(NamedTuple):
    """The side of triangles that all of the light is on, as `disc_sides` has it.

    `own (t,)`; `casts (t,)` whether a triangle is solid; of clusters of `solid` and `sheer` ones.
    """

    own: NDArray[np.int8]
    casts: NDArray[np.bool_]
    solid: NDArray[np.int8]
    sheer: NDArray[np.int8]


def _shadow_block(
    casters: Casters,
    disc: LightDisc,
    samples: ViewSamples,
    first: int,
    sides: _Sides,
    key: np.uint64 | None,
    found: Found,
    clock: Clock,
) -> NDArray[np.int64]:
    """Decide the samples of one hierarchy, which begin with number `first` of all; returns the counters."""
    source, count = disc.source, len(disc.pattern)
    with clock.span("hierarchy"):
        bounds = bounds_with(casters.bounds, samples)
        largest = float(np.abs(bounds).max())
        on_surface = samples.camera is not None or bool((samples.triangle >= 0).any())
        error = POSITION_ERROR * largest + surface_error(bounds) if on_surface else 0.0
        frames = light_frames(source, bounds, error)
        turned_away = np.zeros(samples.size, bool)
        limits = error, 2.0**-50 * largest
        # Only samples whose own solid triangle turns its back on all of the light are left out.
        shading = np.where(sides.casts, sides.own, np.int8(0))
        leaves, trees = build(samples, samples.covered.reshape(-1), shading, source, frames, limits, turned_away, clock)
        found.bits[turned_away] = -1
    dice = Dice(0, np.uint64(0), 0) if key is None else Dice(count, key, first * count)
    active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]

    def shade(
        clusters: TriangleClusters, cast: NDArray[np.int8], own: NDArray[np.int8], table: Transmission | None
    ) -> Any:
        """Send clusters down all trees; with a `table` those that let light through, and write what arrives."""
        total = np.zeros(len(COUNTERS), np.int64)
        for frame, tree in active:
            regions = cluster_tree(clusters.corners, cast, disc, frame, clock)

            def task(node: int, frame=frame, tree=tree, regions=regions) -> NDArray[np.int64]:  # type: ignore[no-untyped-def]
                counted, dimming = np.zeros(len(COUNTERS), np.int64), None
                if table is not None:
                    below = min(LANES * LANES, len(tree.slot) - node * LANES * LANES)
                    dimming = AreaDimming(table, dice, full_light(below, count))
                shade_node(
                    casters.scene.positions, casters.scene.triangles, own, clusters.corners, clusters.order, cast,
                    *regions, disc, frame, samples.barycentric.reshape(-1, 2), samples.side.reshape(-1),
                    samples.position.reshape(-1, 3), first, leaves.place, leaves.ids, leaves.box, *tree, node,
                    found.bits, dimming, counted,
                )  # fmt: skip
                if dimming is not None:
                    write_arriving(node, tree.slot, leaves.ids, found.bits, dimming.left, *found[1:])
                return counted

            nodes = int(tree.level[2] - tree.level[1]) if len(tree.level) > 2 else 1
            total += np.sum(run(task, nodes, clock), axis=0, dtype=np.int64)
        return total

    def write(number: int) -> None:
        start, stop = number * _SAMPLES_PER_TASK, min((number + 1) * _SAMPLES_PER_TASK, samples.size)
        write_shares(start, stop, found.bits, count, *found[1:])

    stats: NDArray[np.int64] = np.zeros(len(COUNTERS), np.int64)
    with clock.span("traversal"):
        if len(casters.solid.corners):
            # 1: a triangle that is not solid darkens none of its samples.
            stats += shade(casters.solid, sides.solid, np.where(sides.casts, sides.own, np.int8(1)), None)
    with clock.span("merge"):
        run(write, -(-samples.size // _SAMPLES_PER_TASK), clock)
    if casters.sheer is not None:
        with clock.span("transmission"):
            stats += shade(casters.sheer, sides.sheer, sides.own, casters.table)
    leaves.release(sum(len(tree.slot) for _, tree in active))
    return stats


def _cull(solids: Solids, disc: LightDisc, order: NDArray[np.int32], sides: NDArray[np.int8]) -> None:
    """Let triangles of solids that face away from all of the light cast nothing, if no light sample is near the solid.

    What holds of each light sample outside a solid, holds of all of them.
    """
    middle, reach = disc.source[:3], disc.reach
    near = ((middle + reach >= solids.lower) & (middle - reach <= solids.upper)).all(axis=1)
    culled = np.append(~near | (disc.source[3] == 0.0), False)[solids.of][order]
    flat = sides.reshape(-1)[: len(culled)]
    flat[culled & (flat == -1)] = 0
