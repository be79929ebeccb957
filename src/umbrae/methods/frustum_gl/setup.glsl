// Shadow frusta of a batch of triangles: the planes in the camera's normalized device coordinates, of those triangles
// that cast a shadow and whose frustum is not surely beside everything that is seen.

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "planes.glsl"
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
layout(std430, binding = 13) readonly buffer Groups { int groups[]; };  // of GROUP triangles each, that are sent down
uniform int first, count, total;  // of triangles: where the batch begins in these groups, its length; of the scene
uniform bool see_through;  // whether the triangles that let light through are wanted, or those that do not

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
    int place = first + index, triangle = GROUP * groups[place / GROUP] + place % GROUP;
    if (triangle >= total) return;
    int side = facings[triangle];
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
    uint made = atomicAdd(counters[FRUSTA], 1u);
    atomicMax(counters[FRUSTA_GROUPS + 1], made / GROUPS_X + 1u);
    uint row = ROWS * made;
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
