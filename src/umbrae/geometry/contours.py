"""Where a surface with smooth normals turns away from the light (Mattausch et al. 2012, section 3.1).

At each vertex, f = n . (l - w v) says whether the smooth surface faces the homogeneous light (l, w); along an edge it
is interpolated linearly. Where it changes sign, the *accurate silhouette* (Hertzmann and Zorin 2000) crosses the edge,
at a *breakpoint*. It runs on through the triangle to its other edge with a change of sign, and so in loops, which end
only where the mesh is open.

The lit part of the surface keeps its orientation, the unlit part is turned over, so that both face the light. What
bounds the oriented whole is the silhouette, twice, edges where normals of the two sides differ (creases) as far as one
side is lit and the other is not, and open edges. That holds for any soup: each triangle contributes by itself, and
what neighbours share cancels.

Flat triangles (see `smooth_mesh`) face the light or not as a whole.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.smooth_mesh import SmoothMesh
from umbrae.geometry.vectors import dot, row, scale, subtract
from umbrae.parallel import inline, kernel, run

BROKEN = -(1 << 31)
"""In place of a multiplicity: an edge with breakpoints, each part of which has its own."""

_ROWS = 1 << 15


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
