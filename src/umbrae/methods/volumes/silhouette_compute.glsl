// Silhouettes found by a compute shader, which lists them for an indirect draw of `quads.glsl`.

#include "multiplicity.glsl"

#ifdef COMPUTE_SHADER
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Positions { float positions[]; };
layout(std430, binding = 1) readonly buffer Edges { int edges[]; };  // lower and higher vertex
layout(std430, binding = 2) readonly buffer Offsets { int offsets[]; };  // of each edge into the opposite vertices
layout(std430, binding = 3) readonly buffer Opposite { int opposite[]; };
layout(std430, binding = 4) writeonly buffer Entries { float entries[]; };  // a, b, multiplicity
layout(std430, binding = 5) buffer Command { uint vertex_count, instance_count, first_vertex, first_instance; };
uniform int edge_count;

vec3 vertex_position(int id) {
    return vec3(positions[3 * id], positions[3 * id + 1], positions[3 * id + 2]);
}

void main() {
    int edge = int(gl_GlobalInvocationID.x);
    if (edge >= edge_count) return;
    int a_id = edges[2 * edge], b_id = edges[2 * edge + 1];
    vec3 a = vertex_position(a_id), b = vertex_position(b_id);
    int m = 0;
    for (int i = offsets[edge]; i < offsets[edge + 1]; i++)
        m += contribution(a_id, b_id, opposite[i], a, b, vertex_position(opposite[i]));
    if (m == 0) return;
#ifdef FLOAT_COUNTER
    int times = 1;
#else
    int times = abs(m);
    m = sign(m);
#endif
    uint first = atomicAdd(instance_count, uint(times));
    for (uint entry = first; entry < first + uint(times); entry++) {
        entries[7 * entry] = a.x;
        entries[7 * entry + 1] = a.y;
        entries[7 * entry + 2] = a.z;
        entries[7 * entry + 3] = b.x;
        entries[7 * entry + 4] = b.y;
        entries[7 * entry + 5] = b.z;
        entries[7 * entry + 6] = intBitsToFloat(m);
    }
}
#endif
