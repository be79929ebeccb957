// Sides of volumes over bent contours, and the bands between those and the mesh (Mattausch et al. 2012, sections 3.2 to
// 4): a patch is one part of the boundary, a cubic Hermite curve, cut into chords by the tessellator.

#include "camera.glsl"
#include "count.glsl"

#ifdef VERTEX_SHADER
in vec3 base_start;  // on the mesh
in vec3 base_end;
in vec3 start;
in vec3 end;
in vec3 along_start;  // derivatives
in vec3 along_end;
in int times;
in int chords;
out vec3 corner[6];
flat out ivec2 number;

void main() {
    corner = vec3[6](base_start, base_end, start, end, along_start, along_end);
    number = ivec2(times, chords);
}
#endif

#ifdef TESS_CONTROL_SHADER
layout(vertices = 1) out;
in vec3 corner[][6];
flat in ivec2 number[];
patch out vec3 shape[6];
patch out ivec2 counts;

void main() {
    shape = corner[0];
    counts = number[0];
    gl_TessLevelOuter[0] = gl_TessLevelOuter[2] = 1.0;
    gl_TessLevelOuter[1] = gl_TessLevelOuter[3] = gl_TessLevelInner[0] = float(counts.y);
    gl_TessLevelInner[1] = 1.0;
}
#endif

#ifdef TESS_EVALUATION_SHADER
// Where there are several columns, a second row appears: at 0.5, which is taken for the first.
layout(quads, equal_spacing, ccw) in;
patch in vec3 shape[6];
patch in ivec2 counts;
flat out int weight;

// The contour's point number k, from both programs and from both of its chords the same to the last bit.
vec3 contour(int k) {
    if (k == 0) return shape[2];
    if (k == counts.y) return shape[3];
    precise float u = float(k) / float(counts.y), w = 1.0 - u;
    precise vec3 point = w * w * ((1.0 + 2.0 * u) * shape[2] + u * shape[4])
                       + u * u * ((1.0 + 2.0 * w) * shape[3] - w * shape[5]);
    return point;
}

void main() {
    int column = int(round(gl_TessCoord.x * float(counts.y)));
    bool far = gl_TessCoord.y > 0.75;
#ifdef SIDES
    vec3 point = contour(counts.y - column);
    gl_Position = far ? project_shadow(point) : project_point(point);
    weight = counts.x;
#else
    // From the contour to the nearer end of the base; one cell in the middle has both.
    vec3 point = far ? shape[2 * column < counts.y ? 0 : 1] : contour(column);
#ifdef DARK_CAPS
    gl_Position = project_shadow(point);
    weight = -counts.x;
#else
    gl_Position = project_point(point);
    gl_Position.z *= 1.0 - 9.5e-7;  // as `caps.glsl` has it
    weight = counts.x;
#endif
#endif
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
