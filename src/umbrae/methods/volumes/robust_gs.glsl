// Robust volumes for low-quality meshes (Stich, Waechter, Keller 2007, section 11.3.1): a triangle with adjacency is
// corner, neighbour, corner, neighbour, corner, neighbour, in the scene's winding. An edge is extruded where the neighbour
// faces the other way, or where there is none; triangles that face away do the same, inverted.

#include "camera.glsl"
#include "corner.glsl"
#include "facing.glsl"
#include "count.glsl"
#include "sides.glsl"

#ifdef GEOMETRY_SHADER
layout(triangles_adjacency) in;
layout(triangle_strip, max_vertices = 24) out;
layout(std430, binding = 1) readonly buffer Casting { int casting[]; };  // 0: any way, else how the ordered triangle faces
in vec3 corner[];
flat in int vertex[];

// Which way a triangle faces by its winding. Its corners are put in order first: wherever the triangle is looked at, from
// inside or from a neighbour, the computation is the same to the last bit.
int winding_facing(int i, int j, int k) {
    int turn = 1, swap;
    if (vertex[j] < vertex[i]) { swap = i; i = j; j = swap; turn = -turn; }
    if (vertex[k] < vertex[j]) { swap = j; j = k; k = swap; turn = -turn; }
    if (vertex[j] < vertex[i]) { swap = i; i = j; j = swap; turn = -turn; }
    return turn * facing(corner[i], corner[j], corner[k]);
}

void main() {
    int faces_light = winding_facing(0, 2, 4);
    bool solid = casting[gl_PrimitiveIDIn] != 0;
    if (faces_light == 0 || (solid && faces_light < 0)) return;
    for (int i = 0; i < 6; i += 2) {
        int next = (i + 2) % 6, beside = i + 1;
        int other = vertex[beside] == vertex[i] ? 0 : winding_facing(next, i, beside);
        if (other == faces_light) continue;
        // A silhouette of two triangles that both cast is extruded twice: at once by the one that faces the light.
        int times = other != 0 && !solid ? 2 : 1;
        if (times == 2 && faces_light < 0) continue;
        bool upwards = vertex[i] < vertex[next];
        int side = upwards ? times * faces_light : -times * faces_light;
        emit_side(corner[upwards ? i : next], corner[upwards ? next : i], side);
    }
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
