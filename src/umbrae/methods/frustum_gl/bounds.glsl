// The box around each group of triangles that follow each other in the scene.

#include "soup.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 10) writeonly buffer Bounds { double bounds[]; };  // lowest x, y, z of a group, then highest
uniform int total, count;  // triangles, groups

void main() {
    int group = invocation();
    if (group >= count) return;
    dvec3 low = corner(group * GROUP, 0), high = low;
    for (int triangle = group * GROUP; triangle < min((group + 1) * GROUP, total); triangle++) {
        for (int which = 0; which < 3; which++) {
            dvec3 vertex = corner(triangle, which);
            low = min(low, vertex);
            high = max(high, vertex);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        bounds[6 * group + axis] = low[axis];
        bounds[6 * group + 3 + axis] = high[axis];
    }
}
#endif
