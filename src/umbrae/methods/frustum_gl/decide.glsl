// The pairs of a sample and a triangle that float32 left open, by the predicate in float64. What that leaves open as well
// is listed for exact arithmetic.

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "invocation.glsl"
#ifdef SEE_THROUGH  // after the others, which it brings as well
#include "dimming.glsl"
#include "transmission.glsl"
#endif

#ifdef COMPUTE_SHADER
layout(std430, binding = 9) buffer Dark { uint dark[]; };
layout(std430, binding = 11) buffer Counters { uint counters[]; };
layout(std430, binding = 13) readonly buffer Queue { ivec2 queue[]; };
layout(std430, binding = 14) writeonly buffer Unsure { ivec2 unsure[]; };
uniform uint room;

// Whether a sample's own triangle may hide it from the light, so that copies of that triangle may, too.
bool may_be_turned_away(int index) {
    int triangle = own_of(index), side = side_of(index);
    int towards = facing(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
    return side != 0 && (towards == UNSURE || side * towards < 0);
}

// Equal triangles are one surface to a sample that lies on either and is not turned away from the light:
// `same_triangle` of geometry/predicates.py.
bool same_triangle(dvec3 a[3], int triangle) {
    dvec3 b[3] = dvec3[3](corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
    bool same = false;
    for (int first = 0; first < 3; first++) {
        bool equal = true, flipped = true;
        for (int i = 0; i < 3; i++) {
            equal = equal && a[i] == b[(first + i) % 3];
            flipped = flipped && a[i] == b[(first + 3 - i) % 3];
        }
        same = same || equal || flipped;
    }
    return same;
}

void main() {
    uint queued = min(counters[QUEUED], room);
    for (uint i = uint(invocation()); i < queued; i += uint(invocations())) {
        int place = queue[i].x, triangle = triangle_of(queue[i].y), word = levels[1].z + place / 32;
        uint bit = 1u << (place % 32);
        if ((dark[word] & bit) != 0u) continue;
        int index = sample_of(child_of(1, node_of(1, place / 32), uint(place % 32)));
        double shift, inward = side_of_light(queue[i].y) < 0 ? 1.0LF : -1.0LF;
        dvec3 point = surface_point(index, shift);
        dvec3 v[3] = dvec3[3](corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
        bool outside = false, inside = true;
        double sides[3];  // of an array: some compilers cannot write to a component by its number
        for (int edge = 0; edge < 4; edge++) {
            dvec2 found = edge == 3 ? plane_value(v[0], v[1], v[2], point, shift)
                : side_value(v[edge], v[(edge + 1) % 3], point, shift);
            if (edge < 3) sides[edge] = abs(found.x);
            outside = outside || inward * found.x < -found.y;
            inside = inside && inward * found.x > found.y;
        }
        if (outside) continue;
        if (inside) {
#ifdef SEE_THROUGH
            // The distances from the side planes are barycentrics, but for their sum (section 3.2).
            double whole = sides[0] + sides[1] + sides[2];
            dvec3 share = share_of(triangle, dvec3(sides[1], sides[2], sides[0]) / whole);
            dim(place, index, triangle, share);
#else
            atomicOr(dark[word], bit);
#endif
        } else if (own_of(index) < 0 || !same_triangle(v, own_of(index)) || may_be_turned_away(index)) {
            unsure[atomicAdd(counters[UNDECIDED], 1u)] = ivec2(index, triangle);
        }
    }
}
#endif
