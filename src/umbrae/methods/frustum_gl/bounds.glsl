// The box around each group of triangles that follow each other in the scene.
//
// Of numbers with the order of what they stand for: bits of float32, with the sign or all of them turned over.

#include "soup.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 10) writeonly buffer Bounds { uint bounds[]; };  // bits of a group's lowest x, y, z, then highest
uniform int total, count;  // triangles, groups

uint in_order(uint bits) {
    return (bits >> 31) == 0u ? bits | 0x80000000u : ~bits;
}

uint bits_of_ordered(uint number) {
    return (number >> 31) == 1u ? number & 0x7fffffffu : ~number;
}

void main() {
    int group = invocation();
    if (group >= count) return;
    uvec3 low = uvec3(0xffffffffu), high = uvec3(0u);
    for (int triangle = group * GROUP; triangle < min((group + 1) * GROUP, total); triangle++) {
        for (int which = 0; which < 3; which++) {
            int at = 3 * triangles[3 * triangle + which];
            uvec3 vertex = uvec3(in_order(positions[at]), in_order(positions[at + 1]), in_order(positions[at + 2]));
            low = min(low, vertex);
            high = max(high, vertex);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        bounds[6 * group + axis] = bits_of_ordered(low[axis]);
        bounds[6 * group + 3 + axis] = bits_of_ordered(high[axis]);
    }
}
#endif
