// Samples that their own triangle hides from the light, where it lets some of it through.

#include "tiles.glsl"
#include "transmission.glsl"
#include "soup.glsl"
#include "invocation.glsl"
#include "dimming.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 2) readonly buffer Facing { int facings[]; };
uniform int count;  // of samples

void main() {
    int index = invocation();
    if (index >= count || own_of(index) < 0) return;
    int triangle = own_of(index);
    if (side_of(index) * facings[triangle] >= 0 || kind_of(triangle) == SOLID) return;
    double u = number(samples[index].y), v = number(samples[index].z);
    dim(place_of(0, node_of_sample(index)), index, triangle, share_of(triangle, dvec3(1.0LF - u - v, u, v)));
}
#endif
