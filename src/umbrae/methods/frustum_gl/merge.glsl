// What the tree says of nodes holds for their children (Sintorn et al., section 3.1), down to a verdict for each sample.

#include "tiles.glsl"
#include "samples.glsl"
#include "invocation.glsl"
#ifdef SEE_THROUGH  // after the others, which it brings as well
#include "dimming.glsl"
#endif

#ifdef COMPUTE_SHADER
layout(std430, binding = 9) buffer Dark { uint dark[]; };

#ifdef VERDICTS
layout(std430, binding = 8) readonly buffer Present { uint present[]; };
layout(std430, binding = 15) writeonly buffer Verdict { uint verdict[]; };  // a byte for each sample, 1 in shadow
#ifdef SEE_THROUGH
layout(std430, binding = 22) writeonly buffer Partial { float partial[]; };  // the light that arrives, three a sample
#endif
uniform int count;  // of samples

void main() {
    int first = 4 * invocation();
    if (first >= count) return;
    uint bytes = 0u;
    for (int i = 0; i < 4 && first + i < count; i++) {
        bool covered = own_of(first + i) != BACKGROUND;
        int place = place_of(0, node_of_sample(first + i)), word = levels[1].z + place / 32;
        // One that is left out of the tree is darkened by its own triangle.
        bool hidden = covered && ((dark[word] | ~present[word]) >> (place % 32) & 1u) == 1u;
#ifdef SEE_THROUGH
        bool lit = false;
        for (int channel = 0; channel < 3; channel++) {
            float share = hidden ? 0.0 : (covered ? arriving(place, channel) : 1.0);
            partial[3 * (first + i) + channel] = share;
            lit = lit || share > 0.0;
        }
        hidden = !lit;
#endif
        if (hidden) bytes |= 1u << (8 * i);
    }
    verdict[invocation()] = bytes;
}
#else
uniform int level;  // of the children

void main() {
    int index = invocation();
    if (index >= levels[level].x * levels[level].y) return;
    int lane;
    ivec2 node = node_of(level, index), parent = parent_of(level, node, lane);
#ifdef SEE_THROUGH
    int to = first_sum(level) + 3 * place_of(level, node), from = first_sum(level + 1) + 3 * place_of(level + 1, parent);
    for (int i = 0; i < 3; i++) sums[to + i] = sum_of(sums[to + i], sums[from + i]);
#endif
    if (level == 0) return;
    uint word = dark[levels[level + 1].z + number_of(level + 1, parent)];
    if ((word >> lane & 1u) != 0u) dark[levels[level].z + index] = 0xffffffffu;
}
#endif
#endif
