// Sides of volumes from a list of edges: one instance each.

#include "camera.glsl"
#include "count.glsl"

#ifdef VERTEX_SHADER
in vec3 a;
in vec3 b;
in int multiplicity;
flat out int weight;

// The strip B, A, B at infinity, A at infinity turns its front outwards where the volume's boundary runs from A to B;
// without a counter that takes signs, it is transposed to turn its back, with the same diagonal.
void main() {
    int corner = gl_VertexID;
#ifndef FLOAT_COUNTER
    if (multiplicity < 0) corner = (corner >> 1) | ((corner & 1) << 1);
#endif
    vec3 point = (corner & 1) == 0 ? b : a;
    gl_Position = corner < 2 ? project_point(point) : project_shadow(point);
    weight = multiplicity;
}
#endif

#ifdef FRAGMENT_SHADER
void main() {
    count_face();
}
#endif
