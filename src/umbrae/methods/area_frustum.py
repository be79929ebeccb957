"""The frustum method under a light with a size: all light samples in one go (see `area_traversal`)."""

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.clock import Clock
from umbrae.errors import InputError, OptionError
from umbrae.geometry.solids import Solids
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.area_pairs import MOST
from umbrae.methods.area_samples import LightDisc, light_disc
from umbrae.methods.area_setup import cluster_tree, disc_sides
from umbrae.methods.area_traversal import COUNTERS, shade_node, write_shares
from umbrae.methods.light_frame import POSITION_ERROR, light_frames, surface_error
from umbrae.methods.sample_tree import bounds_with, build
from umbrae.methods.triangle_clusters import TriangleClusters
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import transmission_of

BLOCK = 1 << 23
"""Samples per hierarchy, to bound the memory."""

_SAMPLES_PER_TASK = 1 << 16


def check_light_samples(count: int) -> None:
    """Refuse more light samples than a view sample has bits for."""
    if not 1 <= whole(count, "frustum: light_samples") <= MOST:
        raise OptionError(f"frustum: wanted 1 to {MOST} light samples, got {count}")


def shadow_of_area(
    scene: Scene,
    clusters: TriangleClusters,
    solids: Solids | None,
    light: Light,
    samples: ViewSamples,
    count: int,
    clock: Clock,
) -> ShadowMask:
    """The visible share of a light with a size: `count` light samples for each view sample, each decided exactly.

    Raises
    ------
    InputError
        When the scene lets light through anywhere.
    """
    if transmission_of(scene) is not None:
        raise InputError(
            "frustum: a light with a size in a scene that lets light through; wanted solid materials (alpha_mode "
            '"OPAQUE", no transmission), or a light without a radius or angular_diameter'
        )
    bits, stats = light_bits(scene, clusters, solids, light, samples, count, clock)
    in_shadow, shares = np.empty(samples.size, bool), np.empty((samples.size, 3), np.float32)

    def write(number: int) -> None:
        start, stop = number * _SAMPLES_PER_TASK, min((number + 1) * _SAMPLES_PER_TASK, samples.size)
        write_shares(start, stop, bits, count, in_shadow, shares)

    with clock.span("merge"):
        run(write, -(-samples.size // _SAMPLES_PER_TASK), clock)
    return ShadowMask(
        in_shadow.reshape(samples.shape),
        Guarantee.EXACT,
        stats={**dict(zip(COUNTERS, (int(n) for n in stats), strict=True)), "light_samples": count},
        partial=shares.reshape(*samples.shape, 3),
    )


def light_bits(
    scene: Scene,
    clusters: TriangleClusters,
    solids: Solids | None,
    light: Light,
    samples: ViewSamples,
    count: int,
    clock: Clock,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """`(n,)` bits of all samples: bit i is set where light sample i is hidden; and the counters.

    Those beyond the last light sample are set as well: a view sample is dark where all 64 are.
    """
    bits = np.full(samples.size, -1 << count if count < MOST else 0, np.int64)
    stats = np.zeros(len(COUNTERS), np.int64)
    if not len(scene.triangles) or not samples.size:
        return bits, stats
    disc = light_disc(light, count, samples.shape)
    with clock.span("facing"):
        own_side, sides = disc_sides(scene, clusters, disc, clock)
        if solids is not None:
            _cull(solids, disc, clusters.order, sides)
    width = samples.size // samples.shape[0]
    step = max(4, BLOCK // width // 4 * 4)
    for start in range(0, samples.shape[0], step):
        block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
        part = bits[start * width : (start + step) * width]
        _shadow_block(scene, clusters, disc, block, start * width, own_side, sides, part, stats, clock)
    return bits, stats


def _shadow_block(
    scene: Scene,
    clusters: TriangleClusters,
    disc: LightDisc,
    samples: ViewSamples,
    first: int,
    own_side: NDArray[np.int8],
    sides: NDArray[np.int8],
    bits: NDArray[np.int64],
    stats: NDArray[np.int64],
    clock: Clock,
) -> None:
    source = disc.source
    with clock.span("hierarchy"):
        bounds = bounds_with(clusters.bounds, samples)
        largest = float(np.abs(bounds).max())
        on_surface = samples.camera is not None or bool((samples.triangle >= 0).any())
        error = POSITION_ERROR * largest + surface_error(bounds) if on_surface else 0.0
        frames = light_frames(source, bounds, error)
        turned_away = np.zeros(samples.size, bool)
        limits = error, 2.0**-50 * largest
        # Only samples whose own triangle turns its back on all of the light are left out.
        leaves, trees = build(
            samples, samples.covered.reshape(-1), own_side, source, frames, limits, turned_away, clock
        )
        bits[turned_away] = -1
    raw = samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), samples.position.reshape(-1, 3), first
    with clock.span("traversal"):
        for frame, tree in zip(frames, trees, strict=True):
            if tree is None:
                continue
            regions = cluster_tree(clusters.corners, sides, disc, frame, clock)
            nodes = int(tree.level[2] - tree.level[1]) if len(tree.level) > 2 else 1

            def task(node: int, frame=frame, tree=tree, regions=regions) -> NDArray[np.int64]:  # type: ignore[no-untyped-def]
                counted = np.zeros(len(COUNTERS), np.int64)
                shade_node(
                    scene.positions, scene.triangles, own_side, clusters.corners, clusters.order, sides, *regions, disc,
                    frame, *raw, leaves.place, leaves.ids, leaves.box, *tree, node, bits, counted,
                )  # fmt: skip
                return counted

            stats += np.sum(run(task, nodes, clock), axis=0, dtype=np.int64)
    leaves.release(sum(len(tree.slot) for tree in trees if tree is not None))


def _cull(solids: Solids, disc: LightDisc, order: NDArray[np.int32], sides: NDArray[np.int8]) -> None:
    """Let triangles of solids that face away from all of the light cast nothing, if no light sample is near the solid.

    What holds of each light sample outside a solid, holds of all of them.
    """
    middle, reach = disc.source[:3], disc.reach
    near = ((middle + reach >= solids.lower) & (middle - reach <= solids.upper)).all(axis=1)
    culled = np.append(~near | (disc.source[3] == 0.0), False)[solids.of][order]
    flat = sides.reshape(-1)[: len(culled)]
    flat[culled & (flat == -1)] = 0
