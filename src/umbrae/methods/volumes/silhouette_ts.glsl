// Silhouettes by tessellation (Milet et al., section 2.2): a patch is an edge, its lower vertex first, followed by the
// vertices opposite to it. The control shader finds the multiplicity, the evaluation shader bends one quad into as many.

#include "camera.glsl"
#include "corner.glsl"
#include "multiplicity.glsl"
#include "count.glsl"

#ifdef TESS_CONTROL_SHADER
layout(vertices = 2) out;
in vec3 corner[];
flat in int vertex[];
out vec3 end[];
patch out int multiplicity;

void main() {
    end[gl_InvocationID] = corner[gl_InvocationID];
    if (gl_InvocationID == 0) {
        int m = 0;
        for (int i = 2; i < gl_PatchVerticesIn; i++)
            m += contribution(vertex[0], vertex[1], vertex[i], corner[0], corner[1], corner[i]);
        multiplicity = m;
#ifdef FLOAT_COUNTER
        float columns = 1.0;
#else
        float columns = float(2 * abs(m) - 1);  // between the 2 m columns of vertices of m quads
#endif
        float used = m == 0 ? 0.0 : 1.0;  // an outer level of 0 discards the patch
        gl_TessLevelOuter[0] = gl_TessLevelOuter[2] = used;
        gl_TessLevelOuter[1] = gl_TessLevelOuter[3] = used * columns;
        gl_TessLevelInner[0] = columns;
        gl_TessLevelInner[1] = 1.0;
    }
}
#endif

#ifdef TESS_EVALUATION_SHADER
// Odd: an even number of columns and rows, none in the middle. Where the spacing adds rows next to the two, they
// collapse with them.
layout(quads, fractional_odd_spacing, ccw) in;
in vec3 end[];
patch in int multiplicity;
flat out int weight;

vec4 project_end(int id) {  // B, A, and both at infinity
    vec3 point = (id & 1) == 0 ? end[1] : end[0];
    return id < 2 ? project_point(point) : project_shadow(point);
}

void main() {
    weight = multiplicity;
    int row = int(round(gl_TessCoord.y));
#ifdef FLOAT_COUNTER
    gl_Position = project_end(int(round(gl_TessCoord.x)) + 2 * row);
#else
    // Algorithm 5, with the factor 2 m - 1: every second quad lies on the first; in between, a half turn about its
    // outer vertices keeps the front in front. A volume on the other side transposes the quad: its back is in front, and
    // it splits along the same diagonal.
    int column = int(round(gl_TessCoord.x * float(2 * abs(multiplicity) - 1))) & 3;
    if (column >= 2) row = 1 - row;
    int across = column == 1 || column == 2 ? 1 : 0;
    gl_Position = project_end(multiplicity > 0 ? across + 2 * row : 2 * across + row);
#endif
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
