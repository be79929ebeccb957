// The number of the nearest triangle at each pixel's centre.

#include "camera.glsl"

#ifdef VERTEX_SHADER
in vec3 position;

void main() {
    gl_Position = project_point(position);
    gl_Position.z *= 2.0;  // depth is 1 at the near plane, where OpenGL clips
}
#endif

#ifdef FRAGMENT_SHADER
out int triangle;

void main() {
    triangle = gl_PrimitiveID;
}
#endif
