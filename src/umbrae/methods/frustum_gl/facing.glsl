// On which side of each triangle's plane the light is: 1, -1, 0 edge-on, UNSURE; CULLED instead of -1 where a triangle is
// a solid's that need not cast with its back faces.

#include "soup.glsl"
#include "frustum.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 2) writeonly buffer Facing { int facings[]; };
layout(std430, binding = 11) buffer Counters { uint counters[]; };
#ifdef CULL
layout(std430, binding = 13) readonly buffer Solids { int solids[]; };  // of each triangle; -1: none
layout(std430, binding = 14) readonly buffer Culled { uint culled[]; };  // of each solid
#endif
uniform int count;

void main() {
    int triangle = invocation();
    if (triangle >= count) return;
    int found = facing(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
#ifdef CULL
    if (found < 0 && solids[triangle] >= 0 && culled[solids[triangle]] != 0u) found = CULLED;
#endif
    facings[triangle] = found;
    if (found == UNSURE) atomicAdd(counters[UNDECIDED], 1u);
}
#endif
