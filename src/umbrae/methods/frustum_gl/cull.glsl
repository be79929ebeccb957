// Which groups of triangles may shade a sample that is not dark: 32 lanes for each send the group's box, extruded away from
// the light, down the tree until it meets one (the idea of Stich, Waechter and Keller 2007, section 11.3.3).
//
// With corners c and light (l, w), what the box may shade lies among c + s (w c - l), s >= 0, and all between these. Each lane
// finds one plane that all of it is on the inner side of, if there is one:
// - 6 of the box: those that turn towards the light.
// - 12 through the light and an edge, if no corner is outside. On the edge is V; N . (c - V) has the signs of N's two
//   components, which up to signs are differences of two float32 numbers: rounded in float64, but of the right sign. And what leads
//   away from the light stays inside, as N . (w c - l) = w N . (c - V).
// A box of samples that is beside one of them, by the bound that planes.glsl derives, holds none that the group may shade:
// each such bound is that of a normal e x r with r = w V - l and e along an axis, or of one without any error.
//
// Boxes of many samples may be beside what is shaded and yet not beside one of the planes. So a group is kept, too, when it
// has visited MOST_VISITS nodes and there are more; single samples are decided as well as planes can.

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "planes.glsl"

#ifdef COMPUTE_SHADER
layout(local_size_x = 32) in;
layout(std430, binding = 6) readonly buffer Places { uvec4 places[]; };
layout(std430, binding = 7) readonly buffer Boxes { vec4 boxes[]; };
layout(std430, binding = 8) readonly buffer Present { uint present[]; };
layout(std430, binding = 9) readonly buffer Dark { uint dark[]; };
layout(std430, binding = 10) readonly buffer Bounds { uint bounds[]; };  // bits of a group's lowest x, y, z, then highest
layout(std430, binding = 13) readonly buffer Groups { int groups[]; };  // those that are asked about
layout(std430, binding = 14) writeonly buffer Met { uint met[]; };  // for each of them
uniform int count;  // of groups

const int MOST_VISITS = 64;
const int TURNS = 3;  // see `exchange`

shared vec4 normals[18];
shared vec2 slack[18];
shared uint planes;
shared uint refined[TURNS];
shared uint waiting[MAX_LEVELS * 32];  // children still to be visited: for each level, one copy a lane

dvec3 low, high;  // of the group's box

// Where the rays through a point lead.
dvec3 away(dvec3 point) {
    return light.w * point - light.xyz;
}

dvec3 along(int axis) {
    return dvec3(axis == 0 ? 1.0LF : 0.0LF, axis == 1 ? 1.0LF : 0.0LF, axis == 2 ? 1.0LF : 0.0LF);
}

void keep(Plane made) {
    uint at = atomicAdd(planes, 1u);
    normals[at] = made.normal;
    slack[at] = made.bound;
}

void add_face(int axis, bool upper) {
    dvec3 base = upper ? high : low, normal = (upper ? -1.0LF : 1.0LF) * along(axis);
    if (dot(normal, away(base)) >= 0.0LF) keep(plane(normal, 1.0LF, eye - base));
}

// The plane through the light and the edge along `axis`, at the upper or lower ends of the two others as bits of `ends` say.
void add_side(int axis, int ends) {
    int found = (ends & 1) << ((axis + 1) % 3) | (ends >> 1) << ((axis + 2) % 3);
    bvec3 upper = bvec3((found & 1) != 0, (found & 2) != 0, (found & 4) != 0);
    dvec3 base = mix(low, high, upper), edge = along(axis), leads = away(base);
    // The box lies in these directions from the edge.
    dvec3 rise = cross(leads, edge) * mix(dvec3(1.0LF), dvec3(-1.0LF), upper);
    bool rises = all(greaterThanEqual(rise, dvec3(0.0LF))), falls = all(lessThanEqual(rise, dvec3(0.0LF)));
    if (rises || falls) keep(plane_across(leads, edge, rises ? 1.0LF : -1.0LF, eye - base));
}

// Whether a node is beside what the box may shade; unknown for nodes that hold samples outside the picture.
bool is_beside(vec3 lowest, vec3 highest) {
    if (lowest.x < -UNPLACED) return false;
    vec3 middle = 0.5 * (lowest + highest), half_width = 0.5 * (highest - lowest);
    for (uint i = 0u; i < planes; i++) {
        vec4 n = normals[i];
        float value = dot(n.xyw, middle) + n.z, reach = dot(abs(n.xyw), half_width);
        if (value + reach < -(slack[i].x + slack[i].y * highest.z)) return true;
    }
    return false;
}

// Bits of the lanes that refine. One barrier is enough: what is cleared here was last read before the one before.
uint exchange(int turn, uint lane, bool refine) {
    if (lane == 0u) refined[(turn + 1) % TURNS] = 0u;
    if (refine) atomicOr(refined[turn], 1u << lane);
    memoryBarrierShared();
    barrier();
    return refined[turn];
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (group >= uint(count)) return;
    uint lane = gl_LocalInvocationID.x;
    int task = int(lane), at = 6 * groups[group];
    low = dvec3(number(bounds[at]), number(bounds[at + 1]), number(bounds[at + 2]));
    high = dvec3(number(bounds[at + 3]), number(bounds[at + 4]), number(bounds[at + 5]));
    if (lane < uint(TURNS)) refined[lane] = 0u;
    if (lane == 0u) planes = 0u;
    memoryBarrierShared();
    barrier();
    if (task < 6) add_face(task % 3, task >= 3);
    else if (task < 18) add_side(task % 3, task / 3 - 2);
    memoryBarrierShared();
    barrier();
    int level = depth, visits = 0;
    ivec2 node = ivec2(0);
    bool meets = false;
    while (true) {
        int parent = number_of(level, node), word = levels[level].z + parent;
        int child_at = levels[level - 1].w + 32 * parent + int(lane);
        bool refine = false;
        if (((present[word] & ~dark[word]) >> lane & 1u) != 0u) {
            vec3 lowest, highest;
            if (level == 1) {
                lowest = highest = uintBitsToFloat(places[child_at].xyz);
                if (lowest.x == UNPLACED) lowest.x = -2.0 * UNPLACED;
            } else {
                lowest = boxes[2 * child_at].xyz;
                highest = boxes[2 * child_at + 1].xyz;
            }
            refine = !is_beside(lowest, highest);
        }
        uint left = exchange(visits % TURNS, lane, refine);
        visits++;
        meets = left != 0u && level == 1;
        if (meets) break;
        // The next node: the first child that waits, of this one or of the nearest one above.
        while (left == 0u && level < depth) {
            level++;
            node >>= bits_of(level);
            left = waiting[32 * level + int(lane)];
        }
        if (left == 0u) break;
        meets = visits == MOST_VISITS;
        if (meets) break;
        waiting[32 * level + int(lane)] = left & (left - 1u);
        node = child_of(level, node, uint(findLSB(left)));
        level--;
    }
    if (lane == 0u) met[group] = meets ? 1u : 0u;
}
#endif
