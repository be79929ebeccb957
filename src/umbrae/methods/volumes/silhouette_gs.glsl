// Silhouettes by a geometry shader: a line with adjacency is an edge between the two vertices opposite to it.

#include "camera.glsl"
#include "corner.glsl"
#include "multiplicity.glsl"
#include "count.glsl"
#include "sides.glsl"

#ifdef GEOMETRY_SHADER
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 8) out;
in vec3 corner[];
flat in int vertex[];

void main() {
    int m = contribution(vertex[1], vertex[2], vertex[0], corner[1], corner[2], corner[0]);
    if (vertex[3] != vertex[1])  // else there is no second one
        m += contribution(vertex[1], vertex[2], vertex[3], corner[1], corner[2], corner[3]);
    if (m != 0) emit_side(corner[1], corner[2], m);
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
