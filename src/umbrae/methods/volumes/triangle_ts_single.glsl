// A whole shadow volume for every triangle by tessellation in a single pass (Milet et al., section 2.1, Figure 3): a quad
// of one row, twisted until it is closed. Sides and caps are in separate columns, with columns between them that collapse
// to a line, so that it does not matter along which diagonal the tessellator splits a quad, which OpenGL leaves open.

#include "camera.glsl"
#include "facing.glsl"
#include "count.glsl"

const int COLUMNS = 9;  // between 10 columns of vertices

#ifdef VERTEX_SHADER
in vec3 position;
out vec3 corner;

void main() {
    corner = position;
}
#endif

#ifdef TESS_CONTROL_SHADER
layout(vertices = 4) out;  // the fourth makes a quad of it, and is not used
in vec3 corner[];
out vec3 point[];
patch out int side;

void main() {
    int toward = facing(corner[0], corner[1], corner[2]);
    int from = min(gl_InvocationID, 2);
#ifndef FLOAT_COUNTER
    if (toward < 0) from = 2 - from;
#endif
    point[gl_InvocationID] = corner[from];
    if (gl_InvocationID == 0) {
        side = toward;
        float used = toward == 0 ? 0.0 : 1.0;
        gl_TessLevelOuter[0] = gl_TessLevelOuter[2] = used;
        gl_TessLevelOuter[1] = gl_TessLevelOuter[3] = used * float(COLUMNS);
        gl_TessLevelInner[0] = float(COLUMNS);
        gl_TessLevelInner[1] = 1.0;
    }
}
#endif

#ifdef TESS_EVALUATION_SHADER
layout(quads, fractional_odd_spacing, cw) in;
in vec3 point[];
patch in int side;
flat out int weight;
out float light_cap;

// Of each column, the lower and the upper vertex: 0 to 2 a corner, 3 to 5 the same at infinity. Sides over AB, BC and CA;
// a turn; the light cap; over to infinity; the dark cap.
const int LOWER[10] = int[10](0, 1, 2, 0, 0, 2, 1, 4, 5, 5);
const int UPPER[10] = int[10](3, 4, 5, 3, 0, 1, 1, 4, 3, 3);

void main() {
    int column = int(round(gl_TessCoord.x * float(COLUMNS)));
    int id = gl_TessCoord.y < 0.5 ? LOWER[column] : UPPER[column];
    weight = side;
    light_cap = column == 4 || column == 5 ? 1.0 : 0.0;
    gl_Position = id < 3 ? project_point(point[id]) : project_shadow(point[id - 3]);
}
#endif

#ifdef FRAGMENT_SHADER
#include "own.glsl"
in float light_cap;

void main() {
    place_cap(light_cap > 0.5 ? gl_PrimitiveID : -1);
    count_face();
}
#endif
