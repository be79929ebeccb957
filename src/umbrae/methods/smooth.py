"""Shadows with smooth boundaries of coarse meshes with smooth normals, counted exactly on the CPU."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import number, shown
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.contours import smooth_mesh
from umbrae.geometry.hermite import Curves
from umbrae.geometry.smooth_surface import Rows, SmoothSurface, Tolerance, smooth_surface
from umbrae.geometry.solids import join_over_edges
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.crossing_count import CERTAIN, counting, write_counts
from umbrae.methods.frustum_cpu import BLOCK, MEMORY, _in_parts, _traverse
from umbrae.methods.frustum_leaves import COUNTERS, Receivers
from umbrae.methods.frustum_traversal import merge
from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import POSITION_ERROR, light_frames, surface_error
from umbrae.methods.method import Caster, Method, require_solid
from umbrae.methods.receiver_scale import ReceiverScale
from umbrae.methods.sample_tree import bounds_with, build, hierarchy_bytes
from umbrae.methods.transmission_buffer import merge_sums, reserve
from umbrae.methods.triangle_clusters import TriangleClusters, cluster_triangles
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

SILHOUETTES = ("smooth", "accurate", "discrete")

_LEAVES_PER_TASK = 4096

FINE_PX = 0.25
"""What chords may be off in a picture where no bound is given."""

_FINE = 2.0**-12
"""The same without a picture: of the scene's extent."""


@dataclass(frozen=True)
class Smooth(Method):
    """Shadow boundaries that do not show the tessellation, after Mattausch, Scherzer, Wimmer and Igarashi 2012.

    A coarse mesh with smooth vertex normals casts the shadow of the smooth surface that it stands for. Its silhouette,
    found on the smooth normals (section 3.1), is bent into Hermite curves (3.2), cut into chords (3.3), and joined to
    the mesh by a band (4).

    The shadow volume is not drawn: for each sample the triangles between it and the light are counted, signed by the
    way they face it, with the exact predicate of all methods (`geometry.predicates`) in the hierarchy of `frustum`.

    Deviations from the paper: triangles are cut along the silhouette, and a sample on a cut triangle knows on which
    side of it it lies, so the offset of 0.15 along the negative normal is not needed. Curves are cut into as many
    chords as a bound of their second derivative asks for, instead of by halves; all points lie on one cubic. At
    creases a curve is perpendicular to the normals of both sides. Triangles are turned towards the light one by one,
    so meshes need not be closed, nor wound alike. Bands stand on the silhouette's ends only (`smooth_surface`).

    What it promises: none of the triangles' own shadow, which it changes on purpose. In connected parts without smooth
    normals, and where they do not matter, verdicts are those of `frustum`.

    Options
    -------
    silhouette
        `smooth`, `accurate` (not bent) or `discrete` (that of the triangles, whatever the normals).
    epsilon
        How far chords may lie from the curves, in world units: the paper's bound.
    epsilon_px
        How many pixels of the picture their shadows may be off, wherever light falls on the samples at 3.6 degrees or
        more (see `receiver_scale`); in the middle of a curve that would need more than 64 chords, it may be more. Where
        both bounds are given both hold. Where neither is, a quarter of a pixel, or for samples without a camera 1/4096
        of the scene's extent.
    """

    silhouette: str = "smooth"
    epsilon: float | None = None
    epsilon_px: float | None = None

    name: ClassVar[str] = "smooth"
    paper: ClassVar[str] = "Mattausch, Scherzer, Wimmer, Igarashi 2012"
    guarantee: ClassVar[Guarantee] = Guarantee.NONE

    def __post_init__(self) -> None:
        if self.silhouette not in SILHOUETTES:
            wanted = f"wanted one of {', '.join(SILHOUETTES)}"
            raise OptionError(f"{self.name}: silhouette: {wanted}, got {shown(self.silhouette)}")
        for option, value in (("epsilon", self.epsilon), ("epsilon_px", self.epsilon_px)):
            if value is not None and not number(value, f"{self.name}: {option}") > 0:
                raise OptionError(f"{self.name}: {option}: wanted a positive number, got {value}")

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "SmoothCaster":
        return SmoothCaster(scene, self, clock)


class _Casting(NamedTuple):
    """One light's surface: all it consists of as a soup, and what each triangle does.

    `weight (k,) int32` what a crossing counts; `signed (t,) bool` the soup's triangles in parts that need counting.
    """

    surface: SmoothSurface
    soup: Scene
    weight: NDArray[np.int32]
    signed: NDArray[np.bool_]
    added: TriangleClusters


class SmoothCaster(Caster):
    """The mesh with its edges, and its triangles in clusters; the silhouette is found anew for each light."""

    def __init__(self, scene: Scene, method: Smooth, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        clock = clock or Clock()
        self.scene, self.method = scene, method
        with clock.span("edges"):
            normals = None if method.silhouette == "discrete" else scene.normals
            self.mesh = smooth_mesh(scene.positions, scene.triangles, normals)
            self.part = np.arange(len(scene.triangles), dtype=np.int32)
            join_over_edges(self.mesh.topology.offsets, self.mesh.topology.triangle, self.part)
        self.clusters = cluster_triangles(scene, clock)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        in_shadow = np.zeros(samples.size, bool)
        stats, memory = np.zeros(len(COUNTERS), np.int64), (0, 0)
        if not len(self.scene.triangles) or not samples.size:
            return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT)
        with clock.span("contours"):
            casting = self._casting(light, samples, clock)
        width = samples.size // samples.shape[0]
        step = max(4, BLOCK // width // 4 * 4)
        for start in range(0, samples.shape[0], step):
            block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
            part = slice(start * width, (start + step) * width)
            done, used = self._shadow_block(light, block, casting, in_shadow[part], clock)
            stats += done
            memory = max(memory[0], used[0]), max(memory[1], used[1])
        counters = dict(zip((*COUNTERS, *MEMORY), (*stats.tolist(), *memory), strict=True))
        counters["contour_edges"] = casting.surface.contour_edges
        guarantee = Guarantee.NONE if casting.signed.any() else Guarantee.EXACT
        return ShadowMask(in_shadow.reshape(samples.shape), guarantee, stats=counters)

    def _tolerance(self, light: Light, samples: ViewSamples) -> Tolerance:
        """How far chords may lie from curves, by the method's bounds."""
        epsilon, epsilon_px = self.method.epsilon, self.method.epsilon_px
        if samples.camera is None:
            epsilon_px = None
        elif epsilon is None and epsilon_px is None:
            epsilon_px = FINE_PX
        if epsilon is None:
            extent = float((self.scene.bounds[1] - self.scene.bounds[0]).max())
            epsilon = np.inf if epsilon_px is not None else _FINE * extent
        if epsilon_px is None:
            return lambda curves: np.full(len(curves.p0), epsilon)
        scale, most_px = ReceiverScale.of(self.scene, light, samples), epsilon_px

        def within(curves: Curves) -> Rows:
            with np.errstate(divide="ignore"):
                return np.minimum(most_px / scale.pixels_per_unit(curves), epsilon)

        return within

    def _casting(self, light: Light, samples: ViewSamples, clock: Clock) -> _Casting:
        count = len(self.scene.triangles)
        tolerance = self._tolerance(light, samples) if self.method.silhouette == "smooth" else None
        surface = smooth_surface(self.mesh, light.position, tolerance)
        added = surface.triangles[count:]
        facing = np.concatenate([surface.faces.facing, facing_of_all(surface.positions, added, light.position)])
        weight = surface.chain * facing
        # Parts that are not cut, and of which no triangle counts backwards, shade like any soup.
        counted = np.zeros(count, bool)
        counted[self.part[surface.beside[np.flatnonzero(weight < 0)]]] = True
        counted[self.part[surface.beside[count:]]] = True
        soup = Scene(surface.positions, surface.triangles)
        chosen = count + np.arange(len(added))
        return _Casting(surface, soup, weight, counted[self.part], cluster_triangles(soup, clock, chosen))

    def _shadow_block(
        self, light: Light, samples: ViewSamples, casting: _Casting, in_shadow: NDArray[np.bool_], clock: Clock
    ) -> tuple[NDArray[np.int64], tuple[int, int]]:
        """Decide the samples of one hierarchy; returns `COUNTERS` and `MEMORY`."""
        surface, soup = casting.surface, casting.soup
        source = light.position.astype(np.float64)
        facing, signed = surface.faces.facing, casting.signed
        count = len(facing)
        with clock.span("hierarchy"):
            bounds = bounds_with(soup.bounds.astype(np.float64), samples)
            largest = float(np.abs(bounds).max())
            # Pieces of triangles lie off them by a rounding of their new corners.
            error = 2 * POSITION_ERROR * largest + surface_error(bounds)
            frames = light_frames(source, bounds, error)
            shading = np.where(signed, np.int8(0), facing)
            covered = samples.covered.reshape(-1)
            leaves, trees = build(
                samples, covered, shading, source, frames, (error, 2.0**-50 * largest), in_shadow, clock
            )
        raw = samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), samples.position.reshape(-1, 3)
        receivers = Receivers(soup.positions, soup.triangles, source, *leaves[:3], *raw)
        active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]
        used = [tree for _, tree in active]
        with clock.span("traversal"):
            solid = in_clusters(self.clusters, np.where(signed, np.int8(0), facing))
            stats = _traverse(self.clusters, solid, active, receivers, None, clock)
        with clock.span("merge"):
            for tree in used:
                merge(tree.level, tree.full)
        with clock.span("counting"):
            whole, buffers = reserve(used, CERTAIN)
            dimming = [counting(casting.weight, surface.source, buffer) for buffer in buffers]
            side = np.where(casting.weight != 0, 1, 0).astype(np.int8)
            own_side = np.where(signed & (surface.chain[:count] != 0), facing, np.int8(0))
            added = facing_of_all(soup.positions, soup.triangles[count:], light.position) * side[count:]
            every = np.concatenate([own_side, added])
            stats += _traverse(self.clusters, in_clusters(self.clusters, every), active, receivers, dimming, clock)
            stats += _traverse(casting.added, in_clusters(casting.added, every), active, receivers, dimming, clock)
        with clock.span("merge"):
            for tree, buffer in zip(used, buffers, strict=True):
                merge_sums(tree.level, buffer)
                what = facing, surface.chain, self.mesh.turned, surface.faces.values, in_shadow
                _in_parts(len(tree.slot), _LEAVES_PER_TASK, clock, write_counts, tree, receivers, buffer, *what)
        whole.release()
        leaves.release(sum(len(tree.slot) for tree in used))
        sums = sum(buffer.bytes for buffer in buffers)
        return stats, (hierarchy_bytes(leaves, used), sums + sum(tree.full.nbytes for tree in used))


def in_clusters(clusters: TriangleClusters, values: NDArray[np.int8]) -> NDArray[np.int8]:
    """`(c, 16)`: values `(t,)` of triangles in the clusters' order, 0 beyond the last."""
    arranged = np.zeros((len(clusters.corners), LANES), np.int8)
    arranged.reshape(-1)[: len(clusters.order)] = values[clusters.order]
    return arranged
