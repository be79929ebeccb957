// Boxes extruded away from the light, an instance each: the faces that the light meets, and a side over each edge between
// one that it meets and one that it does not. Seen from outside, what of this is nearest lies before all that is inside.

#include "camera.glsl"

#ifdef VERTEX_SHADER
in vec3 lower;
in vec3 upper;
flat out int box;

bool lit(int axis, int side) {
    return side == 1 ? light[axis] > light.w * upper[axis] : light[axis] < light.w * lower[axis];
}

void main() {
    box = gl_InstanceID;
    int quad = gl_VertexID / 6, place = gl_VertexID % 6;
    place = place > 2 ? 6 - place : place;  // 0 1 2, 3 2 1
    int across = place & 1, along = place >> 1;
    int axis = quad < 6 ? quad >> 1 : (quad - 6) >> 2;
    int next = (axis + 1) % 3, last = (axis + 2) % 3;
    ivec3 side;
    bool drawn, far = false;
    if (quad < 6) {  // a face, perpendicular to the axis
        side[axis] = quad & 1;
        side[next] = across;
        side[last] = along;
        drawn = lit(axis, side[axis]);
    } else {  // over an edge, parallel to the axis
        side[axis] = across;
        side[next] = (quad - 6) & 1;
        side[last] = ((quad - 6) >> 1) & 1;
        drawn = lit(next, side[next]) != lit(last, side[last]);
        far = along == 1;
    }
    vec3 point = vec3(side.x == 1 ? upper.x : lower.x, side.y == 1 ? upper.y : lower.y, side.z == 1 ? upper.z : lower.z);
    gl_Position = !drawn ? vec4(0.0, 0.0, 0.0, 1.0) : (far ? project_shadow(point) : project_point(point));
}
#endif

#ifdef FRAGMENT_SHADER
layout(early_fragment_tests) in;
layout(std430, binding = 0) writeonly buffer Seen { int seen[]; };
flat in int box;

void main() {
    seen[box] = 1;
}
#endif
