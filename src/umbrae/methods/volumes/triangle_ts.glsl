// A shadow volume for every triangle by tessellation, first of two passes (Milet et al., section 2.1, Algorithm 1): inner
// level 3 and outer level 1 make a smaller triangle within the triangle; pushed to infinity it is the dark cap, and the
// ring between the two becomes the sides. The winding is reversed, so that fronts are outside.

#include "camera.glsl"
#include "corner.glsl"
#include "facing.glsl"
#include "count.glsl"

#ifdef TESS_CONTROL_SHADER
layout(vertices = 3) out;
in vec3 corner[];
out vec3 point[];
patch out int side;

void main() {
    int toward = facing(corner[0], corner[1], corner[2]);
    int from = gl_InvocationID;
#ifndef FLOAT_COUNTER
    if (toward < 0) from = 2 - from;
#endif
    point[gl_InvocationID] = corner[from];
    if (gl_InvocationID == 0) {
        side = toward;
        float used = toward == 0 ? 0.0 : 1.0;
        gl_TessLevelOuter[0] = gl_TessLevelOuter[1] = gl_TessLevelOuter[2] = used;
        gl_TessLevelInner[0] = 3.0;
    }
}
#endif

#ifdef TESS_EVALUATION_SHADER
layout(triangles, equal_spacing, cw) in;
in vec3 point[];
patch in int side;
flat out int weight;

void main() {
    weight = side;
    vec3 t = gl_TessCoord;
    int nearest = t.x > t.y && t.x > t.z ? 0 : (t.y > t.z ? 1 : 2);
    bool outer = t.x * t.y * t.z == 0.0;
    gl_Position = outer ? project_point(point[nearest]) : project_shadow(point[nearest]);
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
