// Frusta down the tree of samples, each by one group of 32 lanes (Sintorn et al., Algorithm 1 and section 3.4).
//
// All lanes of a group take the same way: each tests one child of a node, then they exchange what they found as bits in
// shared memory. In large pictures the UPPER part of the tree comes first, and makes a task of each pair of a frustum and
// a node at level BRANCH that meet; a group for each then goes down the LOWER part. That spreads large frusta over many
// groups, and keeps loops short: a task visits at most 1 + 32 + 32 * 32 nodes. (Mesa's software driver ends loops after
// 65535 rounds, all those of an invocation together, without a word.)
//
// Casters that are SEE_THROUGH add to a node's sums what they let through, if that is the same everywhere; else they go
// on to the samples inside, without tests, and leave them to decide.glsl (section 3.2). So do all of them where chance
// decides for each sample.

#include "tiles.glsl"
#include "frustum.glsl"
#if defined(SEE_THROUGH) && !defined(BY_CHANCE)  // after the others, which it brings as well
#define SUMMED
#include "sums.glsl"
#endif

#define WHOLE 0
#define UPPER 1
#define LOWER 2

#ifdef COMPUTE_SHADER
layout(local_size_x = 32) in;
layout(std430, binding = 6) readonly buffer Places { uvec4 places[]; };
layout(std430, binding = 7) readonly buffer Boxes { vec4 boxes[]; };
layout(std430, binding = 8) readonly buffer Present { uint present[]; };
layout(std430, binding = 9) coherent buffer Dark { uint dark[]; };
layout(std430, binding = 10) readonly buffer Frusta { uvec4 frusta[]; };
layout(std430, binding = 11) buffer Counters { uint counters[]; };
layout(std430, binding = 12) buffer Tasks { ivec2 tasks[]; };  // a frustum, and a node at level BRANCH: see `add_task`
layout(std430, binding = 13) writeonly buffer Queue { ivec2 queue[]; };  // places and casters that float32 leaves open
uniform uint room;  // for tasks, and in the queue

const int BRANCH = 3;
#if PART == UPPER
const int LAST = BRANCH + 1;  // level of the last nodes to visit
#else
const int LAST = 1;
#endif
const int TURNS = 3;  // see `exchange`

shared uint refined[TURNS], accepted[TURNS];
shared uint waiting[MAX_LEVELS * 32];  // children still to be visited: for each level, one copy a lane
#ifdef SEE_THROUGH
shared uint sure[MAX_LEVELS * 32];  // those of them that are surely inside
#endif
shared uint tests[4];

Frustum frustum_at(uint index) {
    uint row = ROWS * index;
    Frustum found;
    for (int i = 0; i < 4; i++) found.normal[i] = uintBitsToFloat(frusta[row + i]);
    found.bound = uintBitsToFloat(frusta[row + 4]);
    found.bound_q = uintBitsToFloat(frusta[row + 5]);
#ifdef SILHOUETTE_PLANES
    for (int i = 0; i < 4; i++) found.outline[i] = uintBitsToFloat(frusta[row + 6 + i]);
    found.outline_q = uintBitsToFloat(frusta[row + 10]);
#endif
    return found;
}

// Every lane's verdict as bits, in `refined[turn]` and `accepted[turn]`. One barrier is enough: what is cleared here was
// last read before the barrier of the turn before.
void exchange(int turn, uint lane, int verdict) {
    if (lane == 0u) {
        refined[(turn + 1) % TURNS] = 0u;
        accepted[(turn + 1) % TURNS] = 0u;
    }
    if (verdict == REFINE) atomicOr(refined[turn], 1u << lane);
    if (verdict == ACCEPT) atomicOr(accepted[turn], 1u << lane);
    memoryBarrierShared();
    barrier();
}

// Set the bits of a node's children; a node that becomes full sets its own.
void set_dark(int level, ivec2 node, uint bits) {
    int word = levels[level].z + number_of(level, node);
    uint before = atomicOr(dark[word], bits);
#ifdef SKIP_FULL
    for (; level < depth && (before | bits | ~present[word]) == 0xffffffffu; level++) {
        int lane;
        node = parent_of(level, node, lane);
        bits = 1u << lane;
        word = levels[level + 1].z + number_of(level + 1, node);
        before = atomicOr(dark[word], bits);
    }
#endif
}

void count_up(int counter, uint amount) {
    if (atomicAdd(counters[counter], amount) > 0xffffffffu - amount) atomicAdd(counters[counter + 1], 1u);
}

// What has no room is counted all the same.
void add_task(uint frustum, int node, bool inside) {
    uint place = atomicAdd(counters[TASKS], 1u);
    if (place >= room) return;
    tasks[place] = ivec2(int(frustum), 2 * node + (inside ? 1 : 0));
    atomicMax(counters[TASKS_GROUPS + 1], place / GROUPS_X + 1u);
}

void add_pair(int place, int caster) {
    uint last = atomicAdd(counters[QUEUED], 1u);
    if (last < room) queue[last] = ivec2(place, caster);
}

void main() {
    uint lane = gl_LocalInvocationID.x, group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
#if PART == LOWER
    if (group >= min(counters[TASKS], room)) return;
    uint index = uint(tasks[group].x);
    int start = BRANCH, certain = (tasks[group].y & 1) == 1 ? BRANCH : 0;
    ivec2 node = node_of(BRANCH, tasks[group].y >> 1);
#else
    if (group >= counters[FRUSTA]) return;
    uint index = group;
    int start = depth, certain = 0;  // all nodes up to that level are inside
    ivec2 node = ivec2(0);
#endif
    if (lane < uint(TURNS)) refined[lane] = accepted[lane] = 0u;
    if (lane < 4u) tests[lane] = 0u;
    memoryBarrierShared();
    barrier();
    Frustum frustum = frustum_at(index);
    uvec4 nature = frusta[ROWS * index + 11];
    int caster = int(nature.x), level = start, turn = 0;
    uint tile_tests = 0u, sample_tests = 0u, accepts = 0u, rejects = 0u;
    while (true) {
        int number = number_of(level, node), word = levels[level].z + number;
        int at = levels[level - 1].w + 32 * number + int(lane);
        bool leaf = level == 1, inside = level <= certain;
        uint open = present[word];
#ifdef SKIP_FULL
        open &= ~dark[word];
#endif
        int verdict = REJECT;
        if ((open >> lane & 1u) != 0u) {
            vec3 low, high;
            bool mine = false;
            if (leaf) {
                uvec4 place = places[at];
                low = high = uintBitsToFloat(place.xyz);
                if (low.x == UNPLACED) low.x = -2.0 * UNPLACED;
                mine = int(place.w) == triangle_of(caster);
            } else {
                low = boxes[2 * at].xyz;
                high = boxes[2 * at + 1].xyz;
            }
            if (!mine) verdict = inside ? ACCEPT : test(frustum, low, high);
            if (!mine && !inside) {
                tile_tests += leaf ? 0u : 1u;
                sample_tests += leaf ? 1u : 0u;
                accepts += verdict == ACCEPT ? 1u : 0u;
                rejects += verdict == REJECT ? 1u : 0u;
            }
            bool onward = verdict == REFINE;
#ifdef SUMMED
            if (verdict == ACCEPT && !is_uneven(caster)) {
                int first = first_sum(level - 1) + 3 * at;
                for (int i = 0; i < 3; i++) add_steps(first + i, nature[i + 1]);
            }
#endif
#ifdef SEE_THROUGH
            onward = onward || (verdict == ACCEPT && is_uneven(caster));
#endif
#if PART == UPPER
            if (onward && level == BRANCH + 1) {
                add_task(index, number_of(BRANCH, child_of(level, node, lane)), verdict == ACCEPT);
            }
#else
            if (onward && leaf) add_pair(at, caster);
#endif
        }
        exchange(turn, lane, verdict);
        uint refine = refined[turn], accept = accepted[turn];
        turn = (turn + 1) % TURNS;
#ifdef SEE_THROUGH
        if (!is_uneven(caster)) accept = 0u;
        refine |= accept;
        sure[32 * level + int(lane)] = accept;
#else
        if (lane == 0u && accept != 0u) set_dark(level, node, accept);
#endif
        if (level == LAST) refine = 0u;
        // The next node: the first child that waits, of this one or of the nearest one above.
        while (refine == 0u && level < start) {
            level++;
            node >>= bits_of(level);
            refine = waiting[32 * level + int(lane)];
        }
        if (refine == 0u) break;
        uint child = uint(findLSB(refine));
        waiting[32 * level + int(lane)] = refine & (refine - 1u);
#ifdef SEE_THROUGH
        if (level > certain) certain = (sure[32 * level + int(lane)] >> child & 1u) == 1u ? level - 1 : 0;
#endif
        node = child_of(level, node, child);
        level--;
    }
    atomicAdd(tests[0], tile_tests);
    atomicAdd(tests[1], sample_tests);
    atomicAdd(tests[2], accepts);
    atomicAdd(tests[3], rejects);
    memoryBarrierShared();
    barrier();
    if (lane == 0u) {
        count_up(TILE_TESTS, tests[0]);
        count_up(SAMPLE_TESTS, tests[1]);
        count_up(ACCEPTS, tests[2]);
        count_up(REJECTS, tests[3]);
    }
}
#endif
