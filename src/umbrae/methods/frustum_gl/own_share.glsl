// Samples that their own triangle hides from the light, where it lets some of it through. Those on an edge of a triangle
// that is not closed are left to exact arithmetic: the edge may belong to the neighbour.

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
    int m = material_of(triangle);
    bool closed = materials[m + 6] == 1.0LF && materials[m + 4] == 0.0LF;
    if (!closed && (u == 0.0LF || v == 0.0LF || u + v == 1.0LF)) return;
    dim(place_of(0, node_of_sample(index)), index, triangle, share_of(triangle, dvec3(1.0LF - u - v, u, v)));
}
#endif
