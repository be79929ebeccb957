"""Where a surface with smooth normals turns away from the light (Mattausch et al. 2012, section 3.1).

At each vertex, f = n . (l - w v) says whether the smooth surface faces the homogeneous light (l, w); along an edge it
is interpolated linearly. Where it changes sign, the *accurate silhouette* (Hertzmann and Zorin 2000) crosses the edge,
at a *breakpoint*. It runs on through the triangle to its other edge with a change of sign, and so in loops, which end
only where the mesh is open.

The lit part of the surface keeps its orientation, the unlit part is turned over, so that both face the light. What
bounds the oriented whole is the silhouette, twice, edges where normals of the two sides differ (creases) as far as one
side is lit and the other is not, and open edges. That holds for any soup: each triangle contributes by itself, and
what neighbours share cancels.

Triangles without normals are *flat*: they face the light or not as a whole. So are those with a normal that turns more
than 60 degrees from the facet: no smooth surface looks like that.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import Edges, edges, first_equal, still_welded, weld
from umbrae.geometry.normals import facet_normals
from umbrae.geometry.vectors import cross, dot, row, scale, subtract, unit
from umbrae.parallel import inline, kernel, run

BROKEN = -(1 << 31)
"""In place of a multiplicity: an edge with breakpoints, each part of which has its own."""

_ROWS = 1 << 15

_SMOOTH = 0.5
"""Cosine of the angle up to which vertex normals of a smooth surface turn from a facet: 60 degrees."""

_CREASE = 1e-3
"""Sine of the angle from which two normals tell the direction of the crease between them."""


class SmoothMesh(NamedTuple):
    """What the topology and the normals of a soup alone decide.

    Attributes
    ----------
    positions, triangles
        `(v, 3) float32`, `(t, 3) int32` of the soup.
    welded
        `(v,) int32`: one number per exact position.
    normals
        `(v, 3) float64` of length 1, or zero.
    facets
        `(t, 3) float32` the triangles' own.
    turned
        `(t,) int8`: 1 or -1 where winding and normals agree or not; 0 for a flat triangle, and where another triangle
        has the same corners: a sample on one of them must not meet pieces of the other, which lie off it by a rounding.
    same
        `(t,) int32`: the lowest triangle with the same corners.
    topology
        Edges of the welded triangles.
    low, high
        `(n,) int32`, for each adjacency of `topology`, the triangle's vertex at the edge's lower end and at its higher.
    edge_of
        `(t, 3) int32` the edge from each corner to the next; -1 for a collapsed triangle's.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    welded: NDArray[np.int32]
    normals: NDArray[np.float64]
    facets: NDArray[np.float32]
    turned: NDArray[np.int8]
    same: NDArray[np.int32]
    topology: Edges
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    edge_of: NDArray[np.int32]


class Facing(NamedTuple):
    """Which way everything faces one light.

    `values (v,) float64` f at each vertex; `facing (t,) int8` the side of each triangle that the light is on, exact.
    """

    values: NDArray[np.float64]
    facing: NDArray[np.int8]


class Breakpoints(NamedTuple):
    """Where the silhouette crosses edges.

    `edge (b,) int32` that have breakpoints, ascending; `start (b + 1,) int64` where those of each begin; `u (n,)` their
    places from lower to higher end, ascending; `rank (e,) int32` the place of each edge in `edge`, or -1;
    `multiplicity (n + b,) int32` of the parts between them, edge after edge.
    """

    edge: NDArray[np.int32]
    start: NDArray[np.int64]
    u: NDArray[np.float64]
    rank: NDArray[np.int32]
    multiplicity: NDArray[np.int32]


class Cut(NamedTuple):
    """Triangles that meet breakpoints, in pieces.

    `triangles (k, 3) int32`: vertices of the soup, and from v on breakpoints; `source (k,) int32` what each is a piece
    of; `chain (k,) int32` its orientation. `segments (s, 6) int32` of the silhouette: breakpoint from, its triangle's
    vertices at the lower and the higher end of the edge, and the same of the breakpoint to; `times (s,) int32` how
    often each bounds the surface, `crossed (s,) int32` the triangle that it crosses.
    """

    triangles: NDArray[np.int32]
    source: NDArray[np.int32]
    chain: NDArray[np.int32]
    segments: NDArray[np.int32]
    times: NDArray[np.int32]
    crossed: NDArray[np.int32]


def smooth_mesh(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], normals: NDArray[np.float32] | None
) -> SmoothMesh:
    """Find the topology; `normals (v, 3)` are None for a soup of flat triangles."""
    welded = weld(positions)
    topology = edges(welded[triangles])
    adjacent = triangles[topology.triangle]
    ends = np.repeat(topology.vertices, topology.count, axis=0)
    corner = [np.argmax(welded[adjacent] == ends[:, end, None], axis=1) for end in range(2)]
    rows = np.arange(len(adjacent))
    edge_of = np.full((len(triangles), 3), -1, np.int32)
    number = np.repeat(np.arange(len(topology.vertices), dtype=np.int32), topology.count)
    edge_of[topology.triangle, np.where(topology.sign > 0, *corner)] = number
    same = first_equal(np.sort(welded[triangles], axis=1))
    return SmoothMesh(
        **_placed(positions, triangles, normals, same),
        triangles=triangles,
        welded=welded,
        same=same,
        topology=topology,
        low=adjacent[rows, corner[0]],
        high=adjacent[rows, corner[1]],
        edge_of=edge_of,
    )


def moved_mesh(
    mesh: SmoothMesh, positions: NDArray[np.float32], normals: NDArray[np.float32] | None
) -> SmoothMesh | None:
    """The mesh with its vertices elsewhere; None where they are not surely welded as before."""
    if not still_welded(mesh.welded, positions):
        return None
    return mesh._replace(**_placed(positions, mesh.triangles, normals, mesh.same))


def _placed(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    normals: NDArray[np.float32] | None,
    same: NDArray[np.int32],
) -> dict[str, Any]:
    """What of a mesh depends on its positions and normals."""
    facets = facet_normals(positions, triangles)
    length = np.zeros(len(positions)) if normals is None else np.linalg.norm(normals.astype(np.float64), axis=1)
    vertex_normals = np.zeros((len(positions), 3))
    if normals is not None:
        np.divide(normals, length[:, None], out=vertex_normals, where=length[:, None] > 0)
    along = np.einsum("tkj,tj->tk", vertex_normals[triangles], facets)
    agrees = along.sum(axis=1) >= 0
    smooth = (np.abs(along) >= _SMOOTH).all(axis=1) & (np.sign(along) == np.sign(along[:, :1])).all(axis=1)
    smooth &= np.bincount(same, minlength=len(same))[same] == 1
    turned = np.where(smooth, np.where(agrees, 1, -1), 0).astype(np.int8)
    return {"positions": positions, "normals": vertex_normals, "facets": facets, "turned": turned}


def vertex_values(mesh: SmoothMesh, light: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(v,)` f of every vertex: the same to the last bit wherever position and normal are."""
    values = np.zeros(len(mesh.positions))
    count = len(values)
    run(
        lambda i: fill_values(mesh.positions, mesh.normals, light, i * _ROWS, min((i + 1) * _ROWS, count), values),
        -(-count // _ROWS),
    )
    return values


def edge_multiplicities(mesh: SmoothMesh, faces: Facing) -> NDArray[np.int32]:
    """`(e,)` how often each edge bounds the oriented surface, signed along it; `BROKEN` with breakpoints."""
    topology = mesh.topology
    count = len(topology.vertices)
    multiplicity = np.empty(count, np.int32)
    rows = topology.offsets, topology.triangle, topology.sign, mesh.low, mesh.high, mesh.turned

    def task(i: int) -> None:
        sum_edges(*rows, faces.values, faces.facing, i * _ROWS, min((i + 1) * _ROWS, count), multiplicity)

    run(task, -(-count // _ROWS))
    return multiplicity


def breakpoints(mesh: SmoothMesh, faces: Facing, multiplicity: NDArray[np.int32]) -> Breakpoints:
    """Cut the edges that are `BROKEN`."""
    topology = mesh.topology
    edge = np.flatnonzero(multiplicity == BROKEN).astype(np.int32)
    room = int(topology.count[edge].sum())
    u, start = np.empty(room), np.zeros(len(edge) + 1, np.int64)
    parts = np.empty(room + len(edge), np.int32)
    rows = topology.offsets, topology.triangle, topology.sign, mesh.low, mesh.high, mesh.turned
    break_edges(edge, *rows, faces.values, faces.facing, u, start, parts)
    rank = np.full(len(multiplicity), -1, np.int32)
    rank[edge] = np.arange(len(edge), dtype=np.int32)
    return Breakpoints(edge, start, u[: start[-1]].copy(), rank, parts[: start[-1] + len(edge)].copy())


def cut(mesh: SmoothMesh, faces: Facing, breaks: Breakpoints) -> Cut:
    """Cut the triangles around broken edges along the silhouette."""
    topology = mesh.topology
    counts = topology.count[breaks.edge]
    first = topology.offsets[breaks.edge] - (np.cumsum(counts) - counts)
    chosen = np.unique(topology.triangle[np.repeat(first, counts) + np.arange(counts.sum())])
    on_sides = np.append(np.diff(breaks.start), 0)[breaks.rank[mesh.edge_of[chosen]]]
    around = 3 + on_sides.sum(axis=1, initial=0)
    room = int(around.sum())
    triangles, source, chain = np.empty((room, 3), np.int32), np.empty(room, np.int32), np.empty(room, np.int32)
    segments = np.empty((len(chosen), 6), np.int32)
    times, crossed = np.empty(len(chosen), np.int32), np.empty(len(chosen), np.int32)
    perimeter = np.empty((int(around.max(initial=0)), 3), np.int32)
    made, found = cut_triangles(
        chosen, mesh.triangles, mesh.edge_of, mesh.turned, topology.vertices, mesh.low, mesh.high, topology.offsets,
        topology.triangle, topology.sign, faces.values, faces.facing, breaks.start, breaks.u, breaks.rank,
        len(mesh.positions), perimeter, triangles, source, chain, segments, times, crossed,
    )  # fmt: skip
    return Cut(triangles[:made], source[:made], chain[:made], segments[:found], times[:found], crossed[:found])


def edge_directions(mesh: SmoothMesh, chosen: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`(k, 3)` unit directions of the smooth surface along edges, at their lower and at their higher ends.

    Perpendicular to the normals of all triangles there: the chord projected onto the tangent plane, or at a crease the
    direction that is tangent to both sides. Where that turns away from the chord by 60 degrees or more, the chord; and
    at hollow creases, which never bound a shadow: the light has met one of their sides before.
    """
    found = np.empty((2, len(chosen), 3))
    topology = mesh.topology
    for end, vertex in enumerate((mesh.low, mesh.high)):
        fill_directions(
            chosen, mesh.positions, mesh.triangles, mesh.normals, mesh.facets, mesh.turned, topology.offsets,
            topology.triangle, topology.sign, mesh.low, mesh.high, vertex, found[end],
        )  # fmt: skip
    return found[0], found[1]


@kernel
def fill_values(positions, normals, light, start, stop, values):
    """f of vertices `start` to `stop`."""
    source, w = (light[0], light[1], light[2]), light[3]
    for v in range(start, stop):
        values[v] = dot(row(normals, v), subtract(source, scale(w, row(positions, v))))


@inline
def orientation(t, v, turned, values, facing):
    """How triangle t is to be turned, against its winding, to face the light at its vertex v."""
    if turned[t] == 0:
        return np.int32(facing[t])
    return np.int32(turned[t] if values[v] >= 0.0 else -turned[t])


@inline
def crosses(t, low, high, turned, values):
    """Whether the silhouette crosses the edge between these vertices of triangle t."""
    return turned[t] != 0 and (values[low] >= 0.0) != (values[high] >= 0.0)


@inline
def crossing(low, high, values):
    """Where f is zero between two vertices, in [0, 1]."""
    return values[low] / (values[low] - values[high])


@kernel
def sum_edges(offsets, triangle, sign, low, high, turned, values, facing, start, stop, multiplicity):
    """Multiplicities of edges `start` to `stop`."""
    for e in range(start, stop):
        total, broken = np.int32(0), False
        for entry in range(offsets[e], offsets[e + 1]):
            t = triangle[entry]
            broken |= crosses(t, low[entry], high[entry], turned, values)
            total += sign[entry] * orientation(t, low[entry], turned, values, facing)
        multiplicity[e] = BROKEN if broken else total


@kernel
def break_edges(edge, offsets, triangle, sign, low, high, turned, values, facing, u, start, parts):
    """Breakpoints of the broken edges in order, and multiplicities of the parts between them."""
    for number in range(len(edge)):
        first, last = offsets[edge[number]], offsets[edge[number] + 1]
        begin = start[number]
        end = begin
        for entry in range(first, last):
            if not crosses(triangle[entry], low[entry], high[entry], turned, values):
                continue
            found = crossing(low[entry], high[entry], values)
            at = begin
            while at < end and u[at] < found:
                at += 1
            if at < end and u[at] == found:
                continue
            for later in range(end, at, -1):
                u[later] = u[later - 1]
            u[at] = found
            end += 1
        start[number + 1] = end
        for part in range(end - begin + 1):
            total = np.int32(0)
            for entry in range(first, last):
                t, v = triangle[entry], low[entry]
                own = crosses(t, v, high[entry], turned, values)
                if own and part > 0 and crossing(v, high[entry], values) <= u[begin + part - 1]:
                    v = high[entry]  # beyond its own breakpoint
                total += sign[entry] * orientation(t, v, turned, values, facing)
            parts[begin + number + part] = total


@kernel
def cut_triangles(
    chosen, triangles, edge_of, turned, ends, low, high, offsets, triangle, sign, values, facing, start, u, rank,
    vertices, perimeter, out, source, chain, segments, times, crossed,
):  # fmt: skip
    """Fill what `Cut` holds; returns how many pieces and segments. `perimeter (p, 3)` is scratch space.

    Its rows: a vertex or breakpoint, and for a breakpoint of the triangle's own silhouette the vertices at the lower
    and the higher end of its edge, else -1 twice.
    """
    made, found = 0, 0
    for t in chosen:
        count, own, first, second = 0, 0, 0, 0
        for side in range(3):
            corner = triangles[t, side]
            perimeter[count, 0], perimeter[count, 1] = corner, -1
            count += 1
            e = edge_of[t, side]
            number = rank[e]
            if number < 0:
                continue
            entry = offsets[e]
            while triangle[entry] != t:
                entry += 1
            upwards = sign[entry] > 0
            mine = crosses(t, low[entry], high[entry], turned, values)
            at = crossing(low[entry], high[entry], values) if mine else -1.0
            points = start[number + 1] - start[number]
            for step in range(points):
                point = start[number] + (step if upwards else points - 1 - step)
                perimeter[count, 0], perimeter[count, 1] = vertices + point, -1
                if u[point] == at:
                    perimeter[count, 1], perimeter[count, 2] = low[entry], high[entry]
                    first, second = (count, second) if own == 0 else (first, count)
                    own += 1
                count += 1
        way = orientation(t, triangles[t, 0], turned, values, facing)
        if own == 0:
            made = fan(perimeter, count, 0, count, t, way, made, out, source, chain)
            continue
        # From the first own breakpoint to the second lies what corner 0 does not belong to.
        made = fan(perimeter, count, first, second - first + 1, t, -way, made, out, source, chain)
        made = fan(perimeter, count, second, count - second + first + 1, t, way, made, out, source, chain)
        # Both run along the silhouette: the one from the second to the first closes it that way, with -way.
        segments[found, 0], segments[found, 3] = perimeter[second, 0] - vertices, perimeter[first, 0] - vertices
        for column in range(1, 3):
            segments[found, column], segments[found, 3 + column] = perimeter[second, column], perimeter[first, column]
        times[found], crossed[found] = -2 * way, t
        found += 1
    return made, found


@inline
def fan(perimeter, count, first, length, t, way, made, out, source, chain):
    """Triangles of a polygon of `length` points around a perimeter, from `first`; returns how many are made by now."""
    for step in range(1, length - 1):
        out[made, 0] = perimeter[first, 0]
        out[made, 1] = perimeter[(first + step) % count, 0]
        out[made, 2] = perimeter[(first + step + 1) % count, 0]
        source[made], chain[made] = t, way
        made += 1
    return made


@inline
def normal_at(t, v, turned, normals, facets):
    """The normal of triangle t at its vertex v."""
    return row(facets, t) if turned[t] == 0 else row(normals, v)


@inline
def hollow(positions, triangles, facets, turned, triangle, sign, first, last):
    """Whether the two triangles of an edge, wound alike, are turned towards each other."""
    if last - first != 2 or sign[first] == sign[first + 1]:
        return False
    s, t = triangle[first], triangle[first + 1]
    outwards = scale(-1.0 if turned[s] < 0 else 1.0, row(facets, s))
    rise = 0.0
    for k in range(3):
        rise += dot(outwards, subtract(row(positions, triangles[t, k]), row(positions, triangles[s, 0])))
    return rise > 0.0


@kernel
def fill_directions(
    chosen, positions, triangles, normals, facets, turned, offsets, triangle, sign, low, high, vertex, out
):
    """`edge_directions` at one end, that of `vertex`."""
    for number in range(len(chosen)):
        first, last = offsets[chosen[number]], offsets[chosen[number] + 1]
        chord = unit(subtract(row(positions, high[first]), row(positions, low[first])))
        one = normal_at(triangle[first], vertex[first], turned, normals, facets)
        found, widest = subtract(chord, scale(dot(one, chord), one)), _CREASE * _CREASE
        for entry in range(first, last):
            one = normal_at(triangle[entry], vertex[entry], turned, normals, facets)
            for other in range(entry + 1, last):
                along = cross(one, normal_at(triangle[other], vertex[other], turned, normals, facets))
                if dot(along, along) > widest:
                    widest = dot(along, along)
                    found = along if dot(along, chord) > 0.0 else scale(-1.0, along)
        found = unit(found)
        if dot(found, chord) < 0.5 or (
            widest > _CREASE * _CREASE and hollow(positions, triangles, facets, turned, triangle, sign, first, last)
        ):
            found = chord
        for axis in range(3):
            out[number, axis] = found[axis]
