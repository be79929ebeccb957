// What exact arithmetic found besides, one entry for each sample.

#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 13) readonly buffer Found { uint found[]; };  // samples
layout(std430, binding = 15) buffer Verdict { uint verdict[]; };
#ifdef SEE_THROUGH
layout(std430, binding = 14) readonly buffer Shares { float shares[]; };  // of light that is let through
layout(std430, binding = 22) buffer Partial { float partial[]; };
#endif
uniform int count;

void main() {
    int i = invocation();
    if (i >= count) return;
    bool hidden = true;
#ifdef SEE_THROUGH
    for (int channel = 0; channel < 3; channel++) {
        uint at = 3u * found[i] + uint(channel);
        partial[at] *= shares[3 * i + channel];
        hidden = hidden && partial[at] == 0.0;
    }
#endif
    if (hidden) atomicOr(verdict[found[i] >> 2], 1u << (8u * (found[i] & 3u)));
}
#endif
