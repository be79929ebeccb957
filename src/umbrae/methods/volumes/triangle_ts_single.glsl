// A whole shadow volume for every triangle by tessellation in a single pass (Milet et al., section 2.1, Figure 3): a quad
// of one row, twisted until it is closed. Sides and caps are in separate columns, with columns between them that collapse
// to a line, so that it does not matter along which diagonal the tessellator splits a quad, which OpenGL leaves open.

#include "camera.glsl"
#include "corner.glsl"
#include "facing.glsl"
#include "count.glsl"

const int COLUMNS = 9;  // between 10 columns of vertices

#ifdef TESS_CONTROL_SHADER
layout(vertices = 3) out;
in vec3 corner[];
flat in int vertex[];
out vec3 point[];
patch out int side;
patch out int triangle;

void main() {
    int toward = facing(corner[0], corner[1], corner[2]);
    int from = gl_InvocationID;
#ifndef FLOAT_COUNTER
    if (toward < 0) from = 2 - from;
#endif
    point[gl_InvocationID] = corner[from];
    if (gl_InvocationID == 0) {
        side = toward;
        // The fourth point, which makes a quad of the triangle, is its number: gl_PrimitiveID starts again and again in
        // long draws on Mesa 22.3.
        triangle = vertex[3];
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
patch in int triangle;
flat out int weight;
flat out int primitive;
out float light_cap;

// Of each column, the lower and the upper vertex: 0 to 2 a corner, 3 to 5 the same at infinity. Sides over AB, BC and CA;
// a turn; the light cap; over to infinity; the dark cap.
const int LOWER[10] = int[10](0, 1, 2, 0, 0, 2, 1, 4, 5, 5);
const int UPPER[10] = int[10](3, 4, 5, 3, 0, 1, 1, 4, 3, 3);

void main() {
    int column = int(round(gl_TessCoord.x * float(COLUMNS)));
    int id = gl_TessCoord.y < 0.5 ? LOWER[column] : UPPER[column];
    weight = side;
    primitive = triangle;
    light_cap = column == 4 || column == 5 ? 1.0 : 0.0;
    gl_Position = id < 3 ? project_point(point[id]) : project_shadow(point[id - 3]);
}
#endif

#ifdef FRAGMENT_SHADER
#include "own.glsl"
flat in int primitive;
in float light_cap;

void main() {
    place_cap(light_cap > 0.5 ? primitive : -1);
    count_face();
}
#endif
