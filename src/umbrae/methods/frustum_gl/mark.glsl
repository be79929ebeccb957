// Samples that exact arithmetic found in shadow.

#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 13) readonly buffer Found { uint found[]; };
layout(std430, binding = 15) buffer Verdict { uint verdict[]; };
uniform int count;

void main() {
    int i = invocation();
    if (i < count) atomicOr(verdict[found[i] >> 2], 1u << (8u * (found[i] & 3u)));
}
#endif
