// Frusta down the tree of samples, each by one group of 32 lanes (Sintorn et al., Algorithm 1 and section 3.4).
//
// All lanes of a group take the same way: each tests one child of a node, then they exchange what they found as bits in
// shared memory. Groups take frusta from a counter until there are none left.

#include "tiles.glsl"
#include "frustum.glsl"

#ifdef COMPUTE_SHADER
layout(local_size_x = 32) in;
layout(std430, binding = 6) readonly buffer Places { uvec4 places[]; };
layout(std430, binding = 7) readonly buffer Boxes { vec4 boxes[]; };
layout(std430, binding = 8) readonly buffer Present { uint present[]; };
layout(std430, binding = 9) coherent buffer Dark { uint dark[]; };
layout(std430, binding = 10) readonly buffer Frusta { vec4 frusta[]; };
layout(std430, binding = 11) buffer Counters { uint counters[]; };
layout(std430, binding = 12) readonly buffer Casting { int casting[]; };
layout(std430, binding = 13) writeonly buffer Queue { ivec2 queue[]; };  // places and triangles that float32 leaves open
uniform uint room;  // in the queue

const int TURNS = 3;  // see `exchange`

shared uint taken;
shared uint refined[TURNS], accepted[TURNS];
shared uint waiting[MAX_LEVELS * 32];  // children still to be visited: for each level, one copy a lane
shared uint tests[4];

Frustum frustum_at(uint index) {
    uint row = ROWS * index;
    Frustum found;
    for (int i = 0; i < 4; i++) found.normal[i] = frusta[row + i];
    found.bound = frusta[row + 4];
    found.bound_q = frusta[row + 5];
#ifdef SILHOUETTE_PLANES
    for (int i = 0; i < 4; i++) found.outline[i] = frusta[row + 6 + i];
    found.outline_q = frusta[row + 10];
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

void main() {
    uint lane = gl_LocalInvocationID.x;
    if (lane < uint(TURNS)) refined[lane] = accepted[lane] = 0u;
    if (lane < 4u) tests[lane] = 0u;
    uint tile_tests = 0u, sample_tests = 0u, accepts = 0u, rejects = 0u;
    int turn = 0;
    while (true) {
        if (lane == 0u) taken = atomicAdd(counters[TAKEN], 1u);
        barrier();
        if (taken >= counters[FRUSTA]) break;
        int caster = casting[taken];
        Frustum frustum = frustum_at(taken);
        int level = depth;
        ivec2 node = ivec2(0);
        while (true) {
            int index = number_of(level, node), word = levels[level].z + index;
            uint open = present[word];
#ifdef SKIP_FULL
            open &= ~dark[word];
#endif
            int verdict = REJECT;
            bool leaf = level == 1;
            if ((open >> lane & 1u) != 0u) {
                int at = levels[level - 1].w + 32 * index + int(lane);
                vec3 low, high;
                bool mine = false;
                if (leaf) {
                    uvec4 place = places[at];
                    low = high = uintBitsToFloat(place.xyz);
                    if (low.x == UNPLACED) low.x = -2.0 * UNPLACED;
                    mine = int(place.w) == caster >> 1;
                } else {
                    low = boxes[2 * at].xyz;
                    high = boxes[2 * at + 1].xyz;
                }
                if (!mine) verdict = test(frustum, low, high);
                tile_tests += leaf ? 0u : 1u;
                sample_tests += leaf && !mine ? 1u : 0u;
                accepts += verdict == ACCEPT ? 1u : 0u;
                rejects += verdict == REJECT && !mine ? 1u : 0u;
                if (leaf && verdict == REFINE) {
                    uint last = atomicAdd(counters[QUEUED], 1u);
                    if (last < room) queue[last] = ivec2(at, caster);
                }
            }
            exchange(turn, lane, verdict);
            uint refine = leaf ? 0u : refined[turn], accept = accepted[turn];
            turn = (turn + 1) % TURNS;
            if (lane == 0u && accept != 0u) set_dark(level, node, accept);
            // The next node: the first child that waits, of this one or of the nearest one above.
            while (refine == 0u && level < depth) {
                level++;
                node >>= bits_of(level);
                refine = waiting[32 * level + int(lane)];
            }
            if (refine == 0u) break;
            waiting[32 * level + int(lane)] = refine & (refine - 1u);
            node = child_of(level, node, uint(findLSB(refine)));
            level--;
        }
    }
    atomicAdd(tests[0], tile_tests);
    atomicAdd(tests[1], sample_tests);
    atomicAdd(tests[2], accepts);
    atomicAdd(tests[3], rejects);
    barrier();
    if (lane == 0u) {
        count_up(TILE_TESTS, tests[0]);
        count_up(SAMPLE_TESTS, tests[1]);
        count_up(ACCEPTS, tests[2]);
        count_up(REJECTS, tests[3]);
    }
}
#endif
