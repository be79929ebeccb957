// Asks predicates.glsl for many triangles and points, for the test that holds it against geometry/predicates.py.

#include "predicates.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 0) readonly buffer Points { uint points[]; };  // three corners and a point
layout(std430, binding = 1) writeonly buffer Values { dvec2 values[]; };  // three side planes and the own, with bounds
layout(std430, binding = 2) writeonly buffer Sides { int sides[]; };
uniform int count;

dvec3 point_at(int at) {
    return dvec3(number(points[3 * at]), number(points[3 * at + 1]), number(points[3 * at + 2]));
}

void main() {
    int i = invocation();
    if (i >= count) return;
    dvec3 a = point_at(4 * i), b = point_at(4 * i + 1), c = point_at(4 * i + 2), p = point_at(4 * i + 3);
    values[4 * i] = side_value(a, b, p, 0.0LF);
    values[4 * i + 1] = side_value(b, c, p, 0.0LF);
    values[4 * i + 2] = side_value(c, a, p, 0.0LF);
    values[4 * i + 3] = plane_value(a, b, c, p, 0.0LF);
    sides[i] = facing(a, b, c);
}
#endif
