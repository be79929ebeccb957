// Which groups of triangles may shade a sample that is not dark: 32 lanes for each send the group's box, extruded away from
// the light, down the tree until it meets one (the idea of Stich, Waechter and Keller 2007, section 11.3.3).
//
// With corners c and light (l, w), what the box may shade is S = { c + s (w c - l), s >= 0 } and all that lies between. Each
// lane finds one plane that S is surely on the inner side of, if there is one:
// - 6 of the box: those that turn towards the light.
// - 12 through the light and an edge, if no other corner is outside. N . (c - V) has the signs of N's components, which
//   are differences of float32 numbers: rounded, but of the right sign. And N . (w c - l) = w N . (c - V).
// - 12 through the eye, which bound S as it is seen: to the left and right, below and above, and through the light and a
//   corner. There N is whatever rounding made of it, turned a little (`TURN`) towards the middle of S, and counts only if
//   N . g is positive by more than rounding can do for each g = c - eye and g = w c - l: three products of sums that are
//   rounded once each are off by less than 2^-50 of their magnitudes.
// A node that is beside one of the planes, by the bound that planes.glsl derives, holds no sample in S. One that is not may
// still hold none: so a group is kept, too, when it has visited MOST_VISITS nodes and there are more.

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
layout(std430, binding = 10) readonly buffer Bounds { double bounds[]; };  // lowest x, y, z of a group, then highest
layout(std430, binding = 13) readonly buffer Groups { int groups[]; };  // those that are asked about
layout(std430, binding = 14) writeonly buffer Met { uint met[]; };  // for each of them
uniform dvec3 rows[3];  // from P - eye to X, Y, W
uniform int count;  // of groups

const int MOST_VISITS = 256;
const int TURNS = 3;  // see `exchange`
const double TURN = 9.5367431640625e-07LF;  // 2^-20
const double CERTAIN = 1.7763568394002505e-15LF;  // 2^-49

shared vec4 normals[32];
shared vec2 slack[32];
shared uint planes;
shared uint refined[TURNS];
shared uint waiting[MAX_LEVELS * 32];  // children still to be visited: for each level, one copy a lane

dvec3 low, high;  // of the group's box

dvec3 box_corner(int number) {
    return dvec3((number & 1) != 0 ? high.x : low.x, (number & 2) != 0 ? high.y : low.y, (number & 4) != 0 ? high.z : low.z);
}

// Where the rays through a point lead.
dvec3 away(dvec3 point) {
    return light.w * point - light.xyz;
}

double largest(dvec3 v) {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

void keep(Plane made) {
    uint at = atomicAdd(planes, 1u);
    normals[at] = made.normal;
    slack[at] = made.bound;
}

void add_face(int axis, bool upper) {
    dvec3 normal = dvec3(0.0LF), base = upper ? high : low;
    double leads = away(base)[axis];
    normal[axis] = upper ? -1.0LF : 1.0LF;
    if (normal[axis] * leads >= 0.0LF) keep(plane(normal, 1.0LF, eye - base));
}

// The plane through the light and the edge along `axis` at the upper or lower end of the box in the other two.
void add_side(int axis, bool upper_i, bool upper_j) {
    int i = (axis + 1) % 3, j = (axis + 2) % 3;
    dvec3 base = low, normal = dvec3(0.0LF);
    if (upper_i) base[i] = high[i];
    if (upper_j) base[j] = high[j];
    dvec3 leads = away(base);
    // Along i and j, the box lies on these sides of the edge.
    double to_i = upper_i ? -1.0LF : 1.0LF, to_j = upper_j ? -1.0LF : 1.0LF;
    double rise_i = leads[j] * to_i, rise_j = -leads[i] * to_j;
    if (rise_i * rise_j < 0.0LF) return;
    double inward = rise_i < 0.0LF || rise_j < 0.0LF ? -1.0LF : 1.0LF;
    normal[i] = inward * leads[j];
    normal[j] = -inward * leads[i];
    keep(plane(normal, abs(normal[i]) + abs(normal[j]), eye - base));
}

// A plane through the eye, if all of S is surely on its inner side.
void add_outline(dvec3 normal) {
    dvec3 middle = 0.5LF * (low + high), ahead = middle - eye, leads = away(middle);
    ahead = ahead / max(largest(ahead), 1e-300LF) + leads / max(largest(leads), 1e-300LF);
    normal += TURN * largest(normal) * ahead;
    bool inside = true;
    for (int number = 0; number < 8; number++) {
        dvec3 vertex = box_corner(number), seen = vertex - eye, far = away(vertex);
        inside = inside && dot(normal, seen) > CERTAIN * dot(abs(normal), abs(seen));
        inside = inside && dot(normal, far) > CERTAIN * dot(abs(normal), abs(far));
    }
    if (inside) keep(plane(normal, abs(normal.x) + abs(normal.y) + abs(normal.z), dvec3(0.0LF)));
}

// The plane where x or y (axis 0 or 1) is as small or large as anywhere in S before the eye.
void add_end(int axis, bool upper) {
    double turned = upper ? -1.0LF : 1.0LF, least = 1e6LF;
    for (int number = 0; number < 16; number++) {
        dvec3 vertex = box_corner(number & 7), to = number < 8 ? vertex - eye : away(vertex);
        double w = dot(rows[2], to), x = turned * dot(rows[axis], to);
        if (w > 0.0LF && x < least * w) least = x / w;
    }
    add_outline(turned * rows[axis] - least * rows[2]);
}

// The plane through the eye, the light and a corner.
void add_beside(int number) {
    dvec3 normal = cross(light.xyz - light.w * eye, box_corner(number) - eye);
    add_outline(dot(normal, 0.5LF * (low + high) - eye) < 0.0LF ? -normal : normal);
}

// Whether no sample in a node is in S; unknown for nodes that hold samples outside the picture.
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
    low = dvec3(bounds[at], bounds[at + 1], bounds[at + 2]);
    high = dvec3(bounds[at + 3], bounds[at + 4], bounds[at + 5]);
    if (lane < uint(TURNS)) refined[lane] = 0u;
    if (lane == 0u) planes = 0u;
    memoryBarrierShared();
    barrier();
    if (task < 6) add_face(task >> 1, (task & 1) != 0);
    else if (task < 18) add_side((task - 6) >> 2, (task & 1) != 0, (task & 2) != 0);
    else if (task < 22) add_end((task - 18) >> 1, (task & 1) != 0);
    else if (task < 30) add_beside(task - 22);
    memoryBarrierShared();
    barrier();
    int level = depth, visits = 0;
    ivec2 node = ivec2(0);
    bool meets = false;
    while (true) {
        int number = number_of(level, node), word = levels[level].z + number;
        int child_at = levels[level - 1].w + 32 * number + int(lane);
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
