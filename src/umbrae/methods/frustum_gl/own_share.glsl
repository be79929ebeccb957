// Samples that their own triangle hides from the light, where it lets some of it through. Those on an edge of a triangle
// that is not closed are left to exact arithmetic: the edge may belong to the neighbour.

#include "sums.glsl"
#include "transmission.glsl"
#include "soup.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 2) readonly buffer Facing { int facings[]; };
uniform int count;  // of samples

void main() {
    int index = invocation();
    if (index >= count || own[index] < 0) return;
    int triangle = own[index];
    if (side_of(index) * facings[triangle] >= 0 || kind_of(triangle) == SOLID) return;
    double u = number(barycentrics[index].x), v = number(barycentrics[index].y);
    int m = material_of(triangle);
    bool closed = materials[m + 6] == 1.0LF && materials[m + 4] == 0.0LF;
    if (!closed && (u == 0.0LF || v == 0.0LF || u + v == 1.0LF)) return;
    dvec3 share = share_of(triangle, dvec3(1.0LF - u - v, u, v));
    int first = 3 * place_of(0, node_of_sample(index));
    for (int i = 0; i < 3; i++) sums[first + i] = sum_of(sums[first + i], steps_of(share[i]));
}
#endif
