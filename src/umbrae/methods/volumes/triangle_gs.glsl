// A shadow volume for every triangle by a geometry shader: its three sides. Corners come in ascending order.

#include "camera.glsl"
#include "corner.glsl"
#include "facing.glsl"
#include "count.glsl"
#include "sides.glsl"

#ifdef GEOMETRY_SHADER
layout(triangles) in;
layout(triangle_strip, max_vertices = 12) out;
in vec3 corner[];

void main() {
    int side = facing(corner[0], corner[1], corner[2]);
    if (side == 0) return;
    emit_side(corner[0], corner[1], side);
    emit_side(corner[1], corner[2], side);
    emit_side(corner[0], corner[2], -side);
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
