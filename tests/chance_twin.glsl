// Asks chance.glsl for many triangles and samples, for the test that holds it against geometry/chance.py.

#include "chance.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 0) readonly buffer Pairs { uvec2 pairs[]; };  // a triangle and a sample
layout(std430, binding = 1) writeonly buffer Found { double found[]; };
uniform uvec2 key;
uniform int count;
uniform uint strata;

void main() {
    int i = invocation();
    if (i < count) found[i] = chance(key, int(pairs[i].x), pairs[i].y, strata);
}
#endif
