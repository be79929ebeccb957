"""The oriented surface whose shadow has smooth boundaries (Mattausch et al. 2012, sections 3.2 to 4).

A soup, cut along its accurate silhouette (see `contours`), and a *band* between that and the smooth contour: Hermite
curves through the silhouette's points, moved onto the curved edges. The shadow volume is what this surface sweeps away
from the light; its sides stand on the smooth contour. All pieces share vertices by number, and each part of the
boundary is bent and cut into chords once, so the volume is closed whatever the coordinates are.

The base of a band is a single edge. The paper moves a point along the accurate silhouette with each point of the
contour; those would not lie exactly on the triangles' edges, and leave slits beside them.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.contours import (
    BROKEN,
    Breakpoints,
    Cut,
    Facing,
    breakpoints,
    cut,
    edge_multiplicities,
    vertex_values,
)
from umbrae.geometry.hermite import Curves, along_surface, curved, dots, straight, units
from umbrae.geometry.smooth_mesh import SmoothMesh, edge_directions
from umbrae.geometry.volume_faces import facing_of_all

Rows = NDArray[np.float64]

Tolerance = Callable[[Curves], Rows]
"""How far chords may lie from each curve, `(k,)` in world units."""

Bend = Callable[[Rows, Rows, Rows, Rows], Curves]
"""Curves between points with unit directions at their ends, such as `hermite.curved`."""


class Boundary(NamedTuple):
    """Parts of the surface's boundary before it is bent.

    Attributes
    ----------
    base, ends
        `(k, 2) int32`: vertices on the soup; those that they are moved to.
    curves
        Those between the ends.
    times
        `(k,) int32`: how often each bounds the surface.
    corners
        `(k, 3) int32`: welded vertices of the soup around each; those of the edge or of the triangle it crosses.
    """

    base: NDArray[np.int32]
    ends: NDArray[np.int32]
    curves: Curves
    times: NDArray[np.int32]
    corners: NDArray[np.int32]


class SmoothSurface(NamedTuple):
    """Triangles that cast signed shadows, and what bounds them.

    Attributes
    ----------
    positions
        `(p, 3) float32`: the soup's vertices first, then breakpoints, then where those are moved to.
    triangles
        `(k, 3) int32`: the soup's first, also those that were cut; then their pieces.
    chain
        `(k,) int32`: how often, and which way against its winding, each is part of the surface; 0 for cut ones.
    source
        `(k,) int32`: the soup's triangle that each is, or is a piece of.
    faces
        Which way the soup faces the light.
    bounds
        The parts of the boundary.
    chords
        `(b,) int64`: into how many chords to cut each.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    chain: NDArray[np.int32]
    source: NDArray[np.int32]
    faces: Facing
    bounds: Boundary
    chords: NDArray[np.int64]

    @property
    def is_the_soup(self) -> bool:
        """Whether nothing was cut, bent, or turned another way than triangles face: shadows are the soup's own.

        An edge-on triangle faces no way, and must be left out.
        """
        whole = len(self.triangles) == len(self.faces.facing)
        return whole and bool((self.chords == 1).all() and (np.sign(self.chain) == self.faces.facing).all())


def core(mesh: SmoothMesh, surface: SmoothSurface) -> NDArray[np.bool_]:
    """`(t,)` triangles of the soup that cast their own shadow, whatever lies about them.

    They count forwards, and touch no triangle that was cut or counts backwards, nor a bent edge. Around the others
    contours may fold, and what they count cancels where it should not: on coarse meshes, thin lines of light. But a
    contour is moved by less than the triangles next to it are wide, so there is nothing to take from the core.
    """
    weight = surface.chain[: len(mesh.triangles)] * surface.faces.facing
    doubtful = weight < 0
    doubtful[surface.source[len(mesh.triangles) :]] = True
    near = np.zeros(len(mesh.positions), bool)
    near[mesh.welded[mesh.triangles[doubtful]]] = True
    bent = (surface.bounds.base != surface.bounds.ends).any(axis=1) | (surface.chords > 1)
    base = surface.bounds.base[bent]
    near[mesh.welded[base[base < len(mesh.positions)]]] = True
    return (weight > 0) & ~near[mesh.welded[mesh.triangles]].any(axis=1)


class Bands(NamedTuple):
    """What closes the surface up to the smooth contour.

    `points (n, 3) float32` between the ends of boundary parts, numbered on from the surface's positions; `triangles
    (k, 3) int32`; `part (k,)` the boundary part that each belongs to, and counts as often as.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.int32]
    part: NDArray[np.intp]


def smooth_surface(
    mesh: SmoothMesh, light: NDArray[np.float32], tolerance: Tolerance | None, bend: Bend = curved
) -> SmoothSurface:
    """The surface of a soup under a homogeneous light `(4,)`.

    Parameters
    ----------
    tolerance
        How far chords may lie from the curves; None to bend nothing: the contour is the accurate silhouette.
    bend
        What makes the curves.
    """
    source = light.astype(np.float64)
    faces = Facing(vertex_values(mesh, source), facing_of_all(mesh.positions, mesh.triangles, light))
    multiplicity = edge_multiplicities(mesh, faces)
    breaks = breakpoints(mesh, faces, multiplicity)
    pieces = cut(mesh, faces, breaks)
    on_edges, bounds = boundary(mesh, multiplicity, breaks, pieces, source, None if tolerance is None else bend)
    chords = np.ones(len(bounds.times), np.int64)
    if tolerance is not None:
        chords = bounds.curves.chords(tolerance(bounds.curves))
    return SmoothSurface(
        positions=np.concatenate([mesh.positions, on_edges.astype(np.float32)]),
        triangles=np.concatenate([mesh.triangles, pieces.triangles]),
        chain=np.concatenate([whole_triangles(mesh, faces, pieces), pieces.chain]),
        source=np.concatenate([np.arange(len(mesh.triangles), dtype=np.int32), pieces.source]),
        faces=faces,
        bounds=bounds,
        chords=chords,
    )


def whole_triangles(mesh: SmoothMesh, faces: Facing, pieces: Cut) -> NDArray[np.int32]:
    """`(t,)` the orientation of triangles that were not cut; 0 for those that were, or have two equal corners."""
    lit = faces.values[mesh.triangles[:, 0]] >= 0
    chain = np.where(mesh.turned == 0, faces.facing, np.where(lit, mesh.turned, -mesh.turned)).astype(np.int32)
    chain[mesh.topology.degenerate] = 0
    chain[pieces.source] = 0
    return chain


def boundary(
    mesh: SmoothMesh,
    multiplicity: NDArray[np.int32],
    breaks: Breakpoints,
    pieces: Cut,
    light: Rows,
    bend: Bend | None,
) -> tuple[Rows, Boundary]:
    """Breakpoints `(n, 3)`, with `bend` followed by where they are moved to, and the parts of the boundary."""
    vertices, shift = len(mesh.positions), len(breaks.u) if bend else 0
    whole = np.flatnonzero((multiplicity != 0) & (multiplicity != BROKEN)).astype(np.int32)
    edges = np.concatenate([whole, breaks.edge])
    first = mesh.topology.offsets[edges]
    ends = np.stack([mesh.low[first], mesh.high[first]], axis=1)
    flat = straight(*mesh.positions.astype(np.float64)[ends.T])
    curves = bend(flat.p0, flat.p1, *edge_directions(mesh, edges)) if bend else flat
    of = len(whole) + np.repeat(np.arange(len(breaks.edge)), np.diff(breaks.start))
    on_soup, moved = flat.take(of).at(breaks.u), curves.take(of).at(breaks.u)
    outer = outlines(mesh, pieces, light)
    hidden = np.zeros(len(moved), bool)
    hidden[pieces.segments[~outer][:, [0, 3]]] = True
    moved[hidden] = on_soup[hidden]

    edge, base, start, stop = _parts(len(whole), ends, breaks, vertices)
    used = np.flatnonzero(np.concatenate([multiplicity[whole], breaks.multiplicity]))
    edge, base = edge[used], base[used]
    places = np.concatenate([mesh.positions.astype(np.float64), moved])
    along = Boundary(
        base,
        np.where(base >= vertices, base + shift, base),
        curves.take(edge).between(start[used], stop[used])._replace(p0=places[base[:, 0]], p1=places[base[:, 1]]),
        np.concatenate([multiplicity[whole], breaks.multiplicity])[used],
        mesh.topology.vertices[edges[edge]][:, [0, 1, 1]],
    )
    across = _through_triangles(mesh, breaks, pieces, moved, outer, bend)
    both = Boundary(
        np.concatenate([along.base, across.base]),
        np.concatenate([along.ends, across.ends]),
        Curves(*(np.concatenate(pair) for pair in zip(along.curves, across.curves, strict=True))),
        np.concatenate([along.times, across.times]),
        np.concatenate([along.corners, across.corners]),
    )
    return (np.concatenate([on_soup, moved]) if bend else on_soup), both


def _parts(
    whole: int, ends: NDArray[np.int32], breaks: Breakpoints, vertices: int
) -> tuple[NDArray[np.intp], NDArray[np.int32], Rows, Rows]:
    """Whole edges, then the parts of broken ones: the row in `ends` of each, its two vertices, and from where to where.

    Breakpoints are numbered from `vertices`.
    """
    counts = np.diff(breaks.start) + 1
    edge = np.concatenate([np.arange(whole), whole + np.repeat(np.arange(len(counts)), counts)])
    base = ends[edge]
    start, stop = np.zeros(len(edge)), np.ones(len(edge))
    last = whole + np.cumsum(counts) - 1
    follows, precedes = np.ones((2, len(edge)), bool)
    follows[:whole] = precedes[:whole] = False
    follows[last - counts + 1] = precedes[last] = False
    numbers = np.arange(len(breaks.u), dtype=np.int32)
    base[follows, 0] = base[precedes, 1] = vertices + numbers
    start[follows] = stop[precedes] = breaks.u
    return edge, base, start, stop


def outlines(mesh: SmoothMesh, pieces: Cut, light: Rows) -> NDArray[np.bool_]:
    """`(s,)` which segments of the silhouette may bound the shadow: where the surface turns away as light goes on.

    f falls along the light's way there. Where it rises the surface is hollow along the light, which has met another
    part of it before: its shadow ends elsewhere. Bent, such a part would only take from that.
    """
    corners = mesh.triangles[pieces.crossed]
    a, b, c = np.moveaxis(mesh.positions.astype(np.float64)[corners], 1, 0)
    values = [dots(mesh.normals[v], light[:3] - light[3] * mesh.positions[v]) for v in corners.T]
    normal = np.cross(b - a, c - a)
    slope = np.cross(normal, values[0][:, None] * (c - b) + values[1][:, None] * (a - c) + values[2][:, None] * (b - a))
    falls: NDArray[np.bool_] = dots(slope, light[3] * (a + b + c) / 3 - light[:3]) < 0
    return falls


def _through_triangles(
    mesh: SmoothMesh, breaks: Breakpoints, pieces: Cut, moved: Rows, outer: NDArray[np.bool_], bend: Bend | None
) -> Boundary:
    """The silhouette's segments from edge to edge, perpendicular to the interpolated normals; `moved (n, 3)` ends."""
    point = pieces.segments[:, [0, 3]]
    p0, p1 = moved[point.T]
    curves = straight(p0, p1)
    if bend:
        directions = []
        for end in range(2):
            share = breaks.u[point[:, end]][:, None]
            low, high = (mesh.normals[pieces.segments[:, 3 * end + corner]] for corner in (1, 2))
            direction = along_surface(p1 - p0, units(low * (1.0 - share) + high * share))
            directions.append(np.where(outer[:, None], direction, units(p1 - p0)))
        curves = bend(p0, p1, *directions)
    base = (len(mesh.positions) + point).astype(np.int32)
    corners = mesh.welded[mesh.triangles[pieces.crossed]]
    return Boundary(base, base + np.int32(len(moved) if bend else 0), curves, pieces.times, corners)


def bands(surface: SmoothSurface) -> Bands:
    """Cut the curves into chords, and the bands into triangles.

    A band is a polygon: the base, and back along the contour. It is cut into triangles around the base's ends, half of
    the contour each, and one between.
    """
    bounds, vertices = surface.bounds, len(surface.positions)
    bent = np.flatnonzero((bounds.base != bounds.ends).any(axis=1) | (surface.chords > 1))
    counts = surface.chords[bent]
    base, ends = bounds.base[bent], bounds.ends[bent]
    first = vertices + np.cumsum(counts - 1) - (counts - 1)
    part, step = _rows_of(counts - 1)
    points = bounds.curves.take(bent[part]).at((step + 1) / counts[part])

    part, step = _rows_of(counts)
    start = np.where(step == 0, ends[part, 0], first[part] + step - 1)
    stop = np.where(step == counts[part] - 1, ends[part, 1], first[part] + step)
    middle = counts // 2
    apex = np.where(step < middle[part], base[part, 0], base[part, 1])
    between = np.where(middle == 0, ends[:, 0], first + middle - 1)
    triangles = np.concatenate(
        [np.stack([apex, start, stop], axis=1), np.stack([base[:, 0], between, base[:, 1]], axis=1)]
    ).astype(np.int32)
    proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return Bands(points.astype(np.float32), triangles[proper], np.concatenate([bent[part], bent])[proper])


def _rows_of(counts: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Each number `i` of `counts (n,)` as many times as it says, and 0, 1, 2 … for each."""
    part = np.repeat(np.arange(len(counts)), counts)
    return part, np.arange(len(part)) - (np.cumsum(counts) - counts)[part]
