// Silhouettes found by compute shaders: the side of every triangle first, then of every edge what those add up to. The
// second pass lists the edges that count for an indirect draw of `quads.glsl`.

#include "multiplicity.glsl"

#ifdef COMPUTE_SHADER
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Positions { float positions[]; };
uniform int count;  // of triangles or edges

int number() {  // of this invocation; groups are laid out in rows, as there is a limit to each side
    return int((gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x);
}

vec3 vertex_position(int id) {
    return vec3(positions[3 * id], positions[3 * id + 1], positions[3 * id + 2]);
}

#ifdef SIDES_OF_TRIANGLES
layout(std430, binding = 1) readonly buffer Triangles { int triangles[]; };  // corners in ascending order
layout(std430, binding = 2) writeonly buffer Sides { int sides[]; };
layout(std430, binding = 3) readonly buffer Kept { int kept[]; };  // triangles that are looked at

void main() {
    int t = number();
    if (t >= count) return;
    t = kept[t];
    vec3 a = vertex_position(triangles[3 * t]), b = vertex_position(triangles[3 * t + 1]);
    sides[t] = contribution(0, 1, 2, a, b, vertex_position(triangles[3 * t + 2]));
}
#else
layout(std430, binding = 1) readonly buffer Edges { int edges[]; };  // lower and higher vertex
layout(std430, binding = 2) readonly buffer Sides { int sides[]; };
layout(std430, binding = 3) readonly buffer Offsets { int offsets[]; };  // of each edge into what is adjacent
// Triangles from 1, negative where their boundary runs down the edge; opposite vertices where each edge decides anew.
layout(std430, binding = 4) readonly buffer Adjacent { int adjacent[]; };
layout(std430, binding = 5) writeonly buffer Entries { float entries[]; };  // a, b, multiplicity
layout(std430, binding = 6) buffer Command { uint vertex_count, instance_count, first_vertex, first_instance; };

void main() {
    int edge = number();
    if (edge >= count) return;
    int a_id = edges[2 * edge], b_id = edges[2 * edge + 1];
    vec3 a = vertex_position(a_id), b = vertex_position(b_id);
    int m = 0;
    for (int i = offsets[edge]; i < offsets[edge + 1]; i++) {
#if DETERMINISM == NONE
        m += contribution(a_id, b_id, adjacent[i], a, b, vertex_position(adjacent[i]));
#else
        m += sign(adjacent[i]) * sides[abs(adjacent[i]) - 1];
#endif
    }
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
#endif
