// Asks `facing` of facing.glsl for many triangles, for the test that holds it against the CPU's predicate.

#include "facing.glsl"

#ifdef COMPUTE_SHADER
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Corners { float corners[]; };
layout(std430, binding = 1) writeonly buffer Sides { int sides[]; };
uniform int count;

vec3 corner(int at) {
    return vec3(corners[3 * at], corners[3 * at + 1], corners[3 * at + 2]);
}

void main() {
    int t = int(gl_GlobalInvocationID.x);
    if (t < count) sides[t] = facing(corner(3 * t), corner(3 * t + 1), corner(3 * t + 2));
}
#endif
