// Verdicts from the tree's words: what is set for a node holds for its children (Sintorn et al., section 3.1).

#include "tiles.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 9) buffer Dark { uint dark[]; };

#ifdef VERDICTS
layout(std430, binding = 3) readonly buffer Own { int own[]; };
layout(std430, binding = 8) readonly buffer Present { uint present[]; };
layout(std430, binding = 15) writeonly buffer Verdict { uint verdict[]; };  // a byte for each sample, 1 in shadow
uniform int count;  // of samples

void main() {
    int first = 4 * invocation();
    if (first >= count) return;
    uint bytes = 0u;
    for (int i = 0; i < 4; i++) {
        if (first + i >= count || own[first + i] < 0) continue;
        int place = place_of(0, node_of_sample(first + i)), word = levels[1].z + place / 32;
        uint bit = 1u << (place % 32);
        // One that is left out of the tree is shaded by its own triangle.
        if (((dark[word] | ~present[word]) & bit) != 0u) bytes |= 1u << (8 * i);
    }
    verdict[invocation()] = bytes;
}
#else
uniform int level;  // of the children

void main() {
    int index = invocation();
    if (index >= levels[level].x * levels[level].y) return;
    int at = place_of(level, node_of(level, index)) - levels[level].w;
    if ((dark[levels[level + 1].z + at / 32] >> uint(at % 32) & 1u) != 0u) dark[levels[level].z + index] = 0xffffffffu;
}
#endif
#endif
