// Light caps (the casting triangles) and dark caps (the same at the volume's far end), oriented like their volume.

#include "camera.glsl"
#include "corner.glsl"
#include "multiplicity.glsl"
#include "count.glsl"
#include "own.glsl"

#ifdef GEOMETRY_SHADER
layout(triangles) in;
layout(triangle_strip, max_vertices = 6) out;
#ifdef FACING_FROM_BUFFER
layout(std430, binding = 1) readonly buffer Facing { int facing_of_primitive[]; };
#endif
in vec3 corner[];
flat out int weight;
flat out int primitive;  // -1 for dark caps

void emit_triangle(vec4 a, vec4 b, vec4 c, int side, int of) {
    vec4 corners[3] = vec4[3](a, b, c);
    for (int i = 0; i < 3; i++) {
#ifdef FLOAT_COUNTER
        gl_Position = corners[i];
        weight = side;
#else
        gl_Position = corners[side > 0 ? i : 2 - i];
#endif
        primitive = of;
        EmitVertex();
    }
    EndPrimitive();
}

// Behind its place by what the rounding of depths may have brought it before that, 2^-20 of the distance.
vec4 project_cap(vec3 point) {
    vec4 clip = project_point(point);
    clip.z *= 1.0 - 9.5e-7;
    return clip;
}

void main() {
#ifdef FACING_FROM_BUFFER
    int side = facing_of_primitive[gl_PrimitiveIDIn];
#else
    int side = contribution(0, 1, 2, corner[0], corner[1], corner[2]);
#endif
    if (side == 0) return;
    emit_triangle(project_cap(corner[0]), project_cap(corner[1]), project_cap(corner[2]), side, gl_PrimitiveIDIn);
#ifdef DARK_CAPS
    if (light.w != 0.0 || far_plane.xyz != vec3(0.0))  // else it is a point
        emit_triangle(project_shadow(corner[0]), project_shadow(corner[1]), project_shadow(corner[2]), -side, -1);
#endif
}
#endif

#ifdef FRAGMENT_SHADER
flat in int primitive;

void main() {
    place_cap(primitive);
    count_face();
}
#endif
