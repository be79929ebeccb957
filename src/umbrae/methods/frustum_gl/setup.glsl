// Shadow frusta of a batch of triangles: the planes in the camera's normalized device coordinates, of those triangles
// that cast a shadow and whose frustum is not surely beside everything that is seen.
//
// A point is P = eye + W (F + x R + y U), where R, U, F are the columns that invert `rows` of place.glsl. So
//
//     N . (P - V) / W = (N . R) x + (N . U) y + N . F + q (N . (eye - V)) / unit = n . (x, y, 1, q).
//
// How far off may the value be that float32 finds at a box's centre, and its half-width there? Let S be the sum of the
// magnitudes of the four summands, with |x|, |y| <= 2 and the box's largest q, and D = |F| + 2 |R| + 2 |U| componentwise.
// - Float32: n and the coordinates are rounded once each (up to 2^-23 where conversion cuts), centre and half-width once
//   more, then four products and three sums: less than 20 steps of 2^-24 on any path, for centre and half-width together.
//   2^-19 S has room for what rounding does to the bound itself.
// - Float64: N is a cross product of differences; with p the sum of its permanents |r_y e_z| + |r_z e_y|, each component
//   is off by less than 2^-50 p, and so are the scalar products with R, U, F and eye - V. A sample's position is off by
//   2^-49 M, with M the largest coordinate (see `surface_point`), its place by a few roundings of |P - eye| <= W |D|. All
//   of that is less than 2^-43 p (D_x + D_y + D_z) + 2^-48 p (|eye - V|_max + M) q / unit.
// - Underflow: n is scaled so that its largest component is 1; what falls below 2^-126 is covered by 2^-100.

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "invocation.glsl"
#ifdef MATERIALS  // after the others, which it brings as well
#include "transmission.glsl"
#include "steps.glsl"
#endif

#ifdef COMPUTE_SHADER
layout(std430, binding = 2) readonly buffer Facing { int facings[]; };
layout(std430, binding = 10) writeonly buffer Frusta { uvec4 frusta[]; };
layout(std430, binding = 7) readonly buffer Boxes { vec4 boxes[]; };
layout(std430, binding = 11) buffer Counters { uint counters[]; };
uniform dvec3 eye;
uniform dvec3 columns[3];  // R, U, F
uniform double unit, reach;  // of q; the largest coordinate
uniform int first, count;
uniform bool see_through;  // whether the triangles that let light through are wanted, or those that do not

const double ROUNDING = 1.9073486328125e-06LF;  // 2^-19
const double PLACED = 1.1368683772161603e-13LF;  // 2^-43
const double MEASURED = 3.552713678800501e-15LF;  // 2^-48
const double UNDERFLOW = 7.888609052210118e-31LF;  // 2^-100

struct Plane {
    vec4 normal;
    vec2 bound;  // constant, and of q
};

// The plane through `base` with this normal; inside is where it points to.
Plane plane(dvec3 normal, double permanent, dvec3 offset) {
    dvec3 spread = abs(columns[2]) + 2.0LF * (abs(columns[0]) + abs(columns[1]));
    dvec4 n = dvec4(dot(normal, columns[0]), dot(normal, columns[1]), dot(normal, columns[2]), dot(normal, offset) / unit);
    double largest = max(max(abs(n.x), abs(n.y)), max(abs(n.z), abs(n.w)));
    double far = max(abs(offset.x), max(abs(offset.y), abs(offset.z))) + reach;
    double flat_bound = ROUNDING * (2.0LF * (abs(n.x) + abs(n.y)) + abs(n.z));
    flat_bound += PLACED * permanent * (spread.x + spread.y + spread.z);
    double deep_bound = ROUNDING * abs(n.w) + MEASURED * permanent * far / unit;
    // Nothing is left of a normal that is zero; its bound is then too large for any decision.
    double scale = 1.0LF / max(largest, 1e-300LF);
    dvec2 bound = min(dvec2(flat_bound, deep_bound) * scale + dvec2(UNDERFLOW), dvec2(1e30LF));
    return Plane(vec4(n * scale), vec2(bound));
}

// The normal r x e times `sign`, off the eye by `offset`.
Plane plane_across(dvec3 r, dvec3 e, double sign, dvec3 offset) {
    dvec3 one = r.yzx * e.zxy, two = r.zxy * e.yzx, permanents = abs(one) + abs(two);
    return plane(sign * (one - two), permanents.x + permanents.y + permanents.z, offset);
}

Plane side_plane(dvec3 a, dvec3 b, double sign) {
    bool turned = after(a, b);
    dvec3 start = turned ? b : a, end = turned ? a : b;
    return plane_across(light.w * start - light.xyz, end - start, turned ? -sign : sign, eye - start);
}

int sign_of(dvec2 found) {
    return found.x > found.y ? 1 : (found.x < -found.y ? -1 : 0);
}

void main() {
    int index = invocation();
    if (index >= count) return;
    int triangle = first + index, side = facings[triangle];
    if (abs(side) != 1) return;
    bool uneven = false;
    uvec3 steps = uvec3(0u);
#ifdef MATERIALS
    int kind = kind_of(triangle);
    if (kind == CLEAR || (kind != SOLID) != see_through) return;
#ifdef BY_CHANCE
    uneven = kind != SOLID;  // chance decides for each sample
#else
    uneven = kind == VARYING;
#endif
    if (kind == EVEN) {
        dvec3 share = share_of(triangle, dvec3(0.0LF));
        steps = uvec3(steps_of(share.x), steps_of(share.y), steps_of(share.z));
    }
#endif
    dvec3 v[3] = dvec3[3](corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
    double inward = side < 0 ? 1.0LF : -1.0LF;  // some compilers cannot convert a negated integer
    Plane planes[4];
    for (int i = 0; i < 3; i++) planes[i] = side_plane(v[i], v[(i + 1) % 3], inward);
    planes[3] = plane_across(v[1] - v[0], v[2] - v[0], inward, eye - v[0]);
    Frustum frustum;
    for (int i = 0; i < 4; i++) {
        frustum.normal[i] = planes[i].normal;
        frustum.bound[i] = planes[i].bound.x;
        frustum.bound_q[i] = planes[i].bound.y;
    }
#ifdef SILHOUETTE_PLANES
    // A plane through eye, light and a vertex bounds the volume if the other vertices are on one side of it; one through
    // eye and edge if the third vertex is on the side that the light is not on (section 3.5).
    dvec3 ahead = light.xyz - light.w * eye;
    dvec3 f[3] = dvec3[3](v[0] - eye, v[1] - eye, v[2] - eye);
    int turn[3];
    for (int i = 0; i < 3; i++) turn[i] = sign_of(determinant_of(ahead, f[i], f[(i + 1) % 3], 0.0LF));
    int front = sign_of(determinant_of(f[0], f[1], f[2], 0.0LF));
    int filled = 0;
    for (int i = 0; i < 4; i++) {
        frustum.outline[i] = vec4(0.0);
        frustum.outline_q[i] = 0.0;
    }
    for (int i = 0; i < 6; i++) {
        int edge = i % 3, before = (edge + 2) % 3, next = (edge + 1) % 3;
        bool through_light = i < 3;
        bool bounds = through_light ? turn[edge] * turn[before] < 0 : turn[edge] * front < 0;
        if (!bounds || filled == 4) continue;
        double toward = (through_light ? turn[edge] : front) < 0 ? -1.0LF : 1.0LF;
        Plane outline = plane_across(through_light ? ahead : f[edge], through_light ? f[edge] : f[next], toward, dvec3(0.0LF));
        frustum.outline[filled] = vec4(outline.normal.xyz, outline.bound.x);
        frustum.outline_q[filled] = outline.bound.y;
        filled++;
    }
#endif
    int root = levels[depth].w;
    if (test(frustum, boxes[2 * root].xyz, boxes[2 * root + 1].xyz) == REJECT) return;
    uint place = atomicAdd(counters[FRUSTA], 1u);
    atomicMax(counters[FRUSTA_GROUPS + 1], place / GROUPS_X + 1u);
    uint row = ROWS * place;
    for (int i = 0; i < 4; i++) frusta[row + i] = floatBitsToUint(frustum.normal[i]);
    frusta[row + 4] = floatBitsToUint(frustum.bound);
    frusta[row + 5] = floatBitsToUint(frustum.bound_q);
#ifdef SILHOUETTE_PLANES
    for (int i = 0; i < 4; i++) frusta[row + 6 + i] = floatBitsToUint(frustum.outline[i]);
    frusta[row + 10] = floatBitsToUint(frustum.outline_q);
#endif
    frusta[row + 11] = uvec4(caster_of(triangle, uneven, side), steps);
}
#endif
