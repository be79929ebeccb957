// One level of the tree: for each node the box around the samples that want a verdict, and a bit for every child that
// has some. Left out are background and samples that their own triangle darkens (Sintorn et al., section 3.5).

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "invocation.glsl"
#ifdef MATERIALS  // after the others, which it brings as well
#include "transmission.glsl"
#endif

#ifdef COMPUTE_SHADER
layout(std430, binding = 2) readonly buffer Facing { int facings[]; };  // of each triangle towards the light
layout(std430, binding = 6) readonly buffer Places { uvec4 places[]; };
layout(std430, binding = 7) buffer Boxes { vec4 boxes[]; };  // lowest x, y, q of a node, then highest
layout(std430, binding = 8) writeonly buffer Present { uint present[]; };
uniform int level;  // of the nodes that are made

const float BEYOND = 4.0;  // stands for everywhere; see `UNPLACED`

void main() {
    int index = invocation();
    if (index >= levels[level].x * levels[level].y) return;
    ivec2 node = node_of(level, index);
    vec3 low = vec3(BEYOND * BEYOND), high = -low;
    high.z = -1.0;
    low.z = 1e38;
    uint bits = 0u;
    for (uint lane = 0u; lane < 32u; lane++) {
        ivec2 child = child_of(level, node, lane);
        if (!exists(level - 1, child)) continue;
        int at = 32 * index + int(lane);
#ifdef LEAVES
        uvec4 place = places[at];
        int triangle = int(place.w);
        if (triangle == BACKGROUND) continue;
        bool solid = triangle >= 0;
#ifdef MATERIALS
        solid = solid && kind_of(triangle) == SOLID;
#endif
        if (solid && side_of(sample_of(child)) * facings[triangle] < 0) continue;
        vec3 here = uintBitsToFloat(place.xyz);
        bool placed = here.x < UNPLACED;
        vec3 child_low = placed ? here : vec3(-BEYOND), child_high = placed ? here : vec3(BEYOND);
#else
        at += levels[level - 1].w;
        vec3 child_low = boxes[2 * at].xyz, child_high = boxes[2 * at + 1].xyz;
        if (child_low.x > child_high.x) continue;
#endif
        bits |= 1u << lane;
        low = min(low, child_low);
        high = max(high, child_high);
    }
    int at = place_of(level, node);
    boxes[2 * at] = vec4(low, 0.0);
    boxes[2 * at + 1] = vec4(high, 0.0);
    present[levels[level].z + index] = bits;
}
#endif
