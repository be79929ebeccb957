"""Frusta against the view-sample hierarchy (Sintorn et al. 2011, Algorithms 1 and 2), a batch of frusta at a time.

The paper sends each frustum down the tree by itself, one warp per frustum. Here a batch of neighbouring triangles
goes together, depth first: every node hands its children the list of those frusta that neither reject nor accept
them. The tests are the same; a node's box stays in registers while the list runs past it, and a node that is found
full ends the whole list. Threads share the tree: they only ever store "in shadow", so no atomics are needed, and a
node that one thread has filled is skipped by all (the paper's section 3.5, "maintaining an updated shadow buffer").

Rejection of a box by a frustum's bounds in x and y is what the silhouette planes towards the eye are in the paper:
it removes the false positives that four planes alone let through.
"""

import numpy as np

from umbrae.geometry.predicates import EXACT, SHADOWED, facing, shadows
from umbrae.methods.frustum_setup import BOUND_PLANE, BOUND_Q, BOUND_SIDES, ROW, set_up_frustum
from umbrae.methods.sample_clusters import DARK, LANES
from umbrae.methods.sample_tree import ARITY, QMAX, QMIN, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import inline, kernel

BATCH = 1024
"""Triangles per task."""

MAX_DEPTH = 16

(TILE_TESTS, SAMPLE_TESTS, ACCEPTS, REJECTS, FALLBACKS, EXACT_TESTS) = range(6)
COUNTERS = (
    "tile_frustum_tests",
    "sample_frustum_tests",
    "accepts",
    "rejects",
    "fallbacks",
    "predicate_fallbacks",
)


@kernel
def facing_chunk(positions, triangles, light, start, stop, out, bounds):
    """Exact side of each triangle's plane that the light is on, and the bounds `(2, 3)` of these triangles."""
    bounds[0], bounds[1] = np.inf, -np.inf
    for t in range(start, stop):
        out[t] = facing(positions, triangles, t, light)
        for corner in range(3):
            for axis in range(3):
                x = positions[triangles[t, corner], axis]
                bounds[0, axis] = min(bounds[0, axis], x)
                bounds[1, axis] = max(bounds[1, axis], x)


@inline
def _set_up(positions, triangles, facing_of, casts, light, frame, box, root, start, stop, ids, rects, rows):
    """Set up the frusta of triangles `start` to `stop` whose bounds meet the root's box; returns how many."""
    rect = np.empty(5, np.float32)
    count = 0
    for t in range(start, stop):
        if facing_of[t] == 0 or (len(casts) > 0 and not casts[t]):
            continue
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if set_up_frustum(positions, i, j, k, light, facing_of[t], frame, box, root, rect, rows[count]):
            for part in range(5):
                rects[part, count] = rect[part]
            ids[count] = t
            count += 1
    return count


@inline
def _against_box(row, xmin, xmax, ymin, ymax, qmin, qmax):
    """Reject (-1), accept (+1) or refine (0): a box's reject and accept corners against the four planes."""
    half = np.float32(0.5)
    cx, hx = half * (xmin + xmax), half * (xmax - xmin)
    cy, hy = half * (ymin + ymax), half * (ymax - ymin)
    # Twice the bound: centre and half-width of the box are themselves rounded.
    limit = np.float32(2.0) * row[BOUND_SIDES]
    inside = True
    for edge in range(3):
        a, b, c = row[3 * edge], row[3 * edge + 1], row[3 * edge + 2]
        middle = a * cx + b * cy + c
        reach = abs(a) * hx + abs(b) * hy
        if middle + reach < -limit:
            return -1
        if not middle - reach > limit:
            inside = False
    a, b, c, d = row[9], row[10], row[11], row[12]
    cq, hq = half * (qmin + qmax), half * (qmax - qmin)
    limit = np.float32(2.0) * (row[BOUND_PLANE] + row[BOUND_Q] * max(abs(qmin), abs(qmax)))
    middle = a * cx + b * cy + c + d * cq
    reach = abs(a) * hx + abs(b) * hy + abs(d) * hq
    if middle + reach < -limit:
        return -1
    if inside and middle - reach > limit:
        return 1
    return 0


@inline
def _leaf(
    slot, listed, count, ids, rows, leaf_x, leaf_y, leaf_q, leaf_own, leaf_sample, leaf_slack, leaf_box,
    positions, triangles, facing_of, light, barycentric, side, position, point, candidate, open_lane, open_id, stats,
):  # fmt: skip
    """Test the samples of a leaf against a list of frusta; returns whether all of them are in shadow now."""
    slack_x, slack_q = leaf_slack[slot, 0], leaf_slack[slot, 1]
    reach_q = max(abs(leaf_box[slot, 4]), abs(leaf_box[slot, 5]))
    open_count = 0
    lit = 0
    for lane in range(LANES):
        lit += leaf_own[slot, lane] != DARK
    if lit == 0:
        return True
    stats[SAMPLE_TESTS] += count * LANES
    for entry in range(count):
        k = listed[entry]
        t = ids[k]
        a0, b0, c0 = rows[k, 0], rows[k, 1], rows[k, 2]
        a1, b1, c1 = rows[k, 3], rows[k, 4], rows[k, 5]
        a2, b2, c2 = rows[k, 6], rows[k, 7], rows[k, 8]
        a3, b3, c3, d3 = rows[k, 9], rows[k, 10], rows[k, 11], rows[k, 12]
        sides = rows[k, BOUND_SIDES] + slack_x
        plane = rows[k, BOUND_PLANE] + slack_x + rows[k, BOUND_Q] * reach_q + abs(d3) * slack_q
        if np.isnan(plane):
            plane = np.float32(np.inf)  # 0 times infinity: nothing is known
        any_candidate = np.int32(0)
        for lane in range(LANES):
            x, y, q = leaf_x[slot, lane], leaf_y[slot, lane], leaf_q[slot, lane]
            e0 = a0 * x + b0 * y + c0
            e1 = a1 * x + b1 * y + c1
            e2 = a2 * x + b2 * y + c2
            e3 = a3 * x + b3 * y + c3 + d3 * q
            low = e0 if e0 < e1 else e1
            low = e2 if e2 < low else low
            own = leaf_own[slot, lane]
            hit = np.int32(low >= -sides) & np.int32(e3 >= -plane) & np.int32(own != t) & np.int32(own != DARK)
            candidate[lane] = hit
            any_candidate |= hit
        if any_candidate == 0:
            continue
        for lane in range(LANES):
            # A full list may have been settled since `candidate` was written.
            if candidate[lane] == 0 or leaf_own[slot, lane] == DARK:
                continue
            x, y, q = leaf_x[slot, lane], leaf_y[slot, lane], leaf_q[slot, lane]
            low = min(a0 * x + b0 * y + c0, a1 * x + b1 * y + c1, a2 * x + b2 * y + c2)
            if low > sides and a3 * x + b3 * y + c3 + d3 * q > plane:
                leaf_own[slot, lane] = DARK
                lit -= 1
            else:
                if open_count == len(open_lane):
                    lit -= _settle(
                        slot, open_lane, open_id, open_count, leaf_own, leaf_sample, positions, triangles, facing_of,
                        light, barycentric, side, position, point, stats,
                    )  # fmt: skip
                    open_count = 0
                open_lane[open_count], open_id[open_count] = lane, t
                open_count += 1
        if lit <= 0:
            return True
    lit -= _settle(
        slot, open_lane, open_id, open_count, leaf_own, leaf_sample, positions, triangles, facing_of,
        light, barycentric, side, position, point, stats,
    )  # fmt: skip
    return lit <= 0


@inline
def _settle(
    slot, open_lane, open_id, open_count, leaf_own, leaf_sample, positions, triangles, facing_of, light,
    barycentric, side, position, point, stats,
):  # fmt: skip
    """Ask the predicate about the pairs that float32 left open and nothing else has shadowed; returns the new ones."""
    found = 0
    for entry in range(open_count):
        lane, t = open_lane[entry], open_id[entry]
        own = leaf_own[slot, lane]
        if own == DARK:
            continue
        index = leaf_sample[slot, lane]
        for axis in range(3):
            point[axis] = position[index, axis]
        answer = shadows(
            positions, triangles, t, facing_of[t], light, own,
            np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1]), np.int64(side[index]), point,
        )  # fmt: skip
        stats[FALLBACKS] += 1
        if answer & EXACT:
            stats[EXACT_TESTS] += 1
        if answer & SHADOWED:
            leaf_own[slot, lane] = DARK
            found += 1
    return found


@inline
def _common_bounds(rects, listed, count, out):
    """Bounds of a list of frusta."""
    xmin, ymin = np.float32(np.inf), np.float32(np.inf)
    xmax, ymax, qmax = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for entry in range(count):
        k = listed[entry]
        xmin, xmax = min(xmin, rects[0, k]), max(xmax, rects[1, k])
        ymin, ymax = min(ymin, rects[2, k]), max(ymax, rects[3, k])
        qmax = max(qmax, rects[4, k])
    out[0], out[1], out[2], out[3], out[4] = xmin, xmax, ymin, ymax, qmax


@kernel
def traverse_batch(
    positions, triangles, facing_of, casts, light, frame, start, stop,
    box, level, slots, full,
    leaf_x, leaf_y, leaf_q, leaf_own, leaf_sample, leaf_slack, leaf_box,
    barycentric, side, position, stats,
):  # fmt: skip
    """Rasterize the frusta of triangles `start` to `stop` over one sample tree."""
    top = len(level) - 2
    root = level[top]
    if full[root]:
        return
    ids = np.empty(BATCH, np.int32)
    rects = np.empty((5, BATCH), np.float32)
    rows = np.empty((BATCH, ROW), np.float32)
    count = _set_up(positions, triangles, facing_of, casts, light, frame, box, root, start, stop, ids, rects, rows)
    if count == 0:
        return
    lists = np.empty((MAX_DEPTH, BATCH), np.int32)
    counts, nodes, nexts = (
        np.empty(MAX_DEPTH, np.int64),
        np.empty(MAX_DEPTH, np.int64),
        np.empty(MAX_DEPTH, np.int64),
    )
    common = np.empty((MAX_DEPTH, 5), np.float32)
    candidate = np.empty(LANES, np.int32)
    open_lane, open_id = np.empty(256, np.int32), np.empty(256, np.int32)
    point = np.empty(3)
    for k in range(count):
        lists[0, k] = k
    # The root is visited as the only child of a place above it.
    depth = 0
    counts[0], nodes[0], nexts[0] = count, 0, 0
    _common_bounds(rects, lists[0], count, common[0])
    while depth >= 0:
        below = top - depth  # level of the children
        first = level[below]
        if nexts[depth] == ARITY or (depth == 0 and nexts[0] == 1):
            if depth > 0:
                # Everything below was visited: full when all children are (empty padding counts as full).
                whole = True
                for child in range(ARITY):
                    node = first + nodes[depth] * ARITY + child
                    whole = whole and (full[node] != 0 or box[XMIN, node] > box[XMAX, node])
                if whole:
                    full[level[below + 1] + nodes[depth]] = 1
            depth -= 1
            continue
        number = nodes[depth] * ARITY + nexts[depth]
        nexts[depth] += 1
        node = first + number
        if full[node]:
            continue
        xmin, xmax = box[XMIN, node], box[XMAX, node]
        ymin, ymax = box[YMIN, node], box[YMAX, node]
        qmin, qmax = box[QMIN, node], box[QMAX, node]
        if xmin > xmax:
            continue
        # The list's common bounds first: neighbouring triangles mostly go the same way.
        stats[TILE_TESTS] += 1
        if (
            common[depth, 0] > xmax
            or common[depth, 1] < xmin
            or common[depth, 2] > ymax
            or common[depth, 3] < ymin
            or common[depth, 4] < qmin
        ):
            stats[REJECTS] += 1
            continue
        here = lists[depth]
        there = lists[depth + 1]
        passed = 0
        for entry in range(counts[depth]):
            k = here[entry]
            there[passed] = k
            passed += np.int64(
                (rects[0, k] <= xmax)
                & (rects[1, k] >= xmin)
                & (rects[2, k] <= ymax)
                & (rects[3, k] >= ymin)
                & (rects[4, k] >= qmin)
            )
        stats[TILE_TESTS] += counts[depth]
        stats[REJECTS] += counts[depth] - passed
        if passed == 0:
            continue
        # The planes say more than the bounds only where the frustum is wider than the box.
        kept = 0
        accepted = False
        for entry in range(passed):
            k = there[entry]
            if rects[1, k] - rects[0, k] > xmax - xmin or rects[3, k] - rects[2, k] > ymax - ymin:
                verdict = _against_box(rows[k], xmin, xmax, ymin, ymax, qmin, qmax)
                if verdict > 0:
                    accepted = True
                    break
                if verdict < 0:
                    continue
            there[kept] = k
            kept += 1
        if accepted:
            stats[ACCEPTS] += 1
            full[node] = 1
            continue
        stats[REJECTS] += passed - kept
        if kept == 0:
            continue
        if below == 0:
            if _leaf(
                slots[number], there, kept, ids, rows, leaf_x, leaf_y, leaf_q, leaf_own, leaf_sample, leaf_slack,
                leaf_box, positions, triangles, facing_of, light, barycentric, side, position, point, candidate,
                open_lane, open_id, stats,
            ):  # fmt: skip
                full[node] = 1
        else:
            depth += 1
            counts[depth], nodes[depth], nexts[depth] = kept, number, 0
            _common_bounds(rects, there, kept, common[depth])


@kernel
def merge(level, slots, full, leaf_own, leaf_sample, in_shadow):
    """Hand every full node's verdict down to its samples and write them out (the paper's merge, section 3.1)."""
    for depth in range(len(level) - 2, 0, -1):
        for number in range(level[depth + 1] - level[depth]):
            if full[level[depth] + number]:
                for child in range(ARITY):
                    node = level[depth - 1] + number * ARITY + child
                    if node < level[depth]:
                        full[node] = 1
    for number in range(len(slots)):
        slot = slots[number]
        for lane in range(LANES):
            if leaf_sample[slot, lane] >= 0 and (full[number] or leaf_own[slot, lane] == DARK):
                in_shadow[leaf_sample[slot, lane]] = True
