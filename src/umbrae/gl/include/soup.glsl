// The triangles of a scene and the samples on them, in buffers.

#include "predicates.glsl"
#include "samples.glsl"

layout(std430, binding = 0) readonly buffer Positions { uint positions[]; };
layout(std430, binding = 1) readonly buffer Triangles { int triangles[]; };

dvec3 corner(int triangle, int which) {
    int vertex = 3 * triangles[3 * triangle + which];
    return dvec3(number(positions[vertex]), number(positions[vertex + 1]), number(positions[vertex + 2]));
}

// The sample's position, off by at most 2^-49 `shift`: `surface_point` of geometry/predicates.py.
dvec3 surface_point(int sample_index, out double shift) {
    uvec4 given = samples[sample_index];
    int triangle = int(given.x);
    if (triangle < 0) {
        shift = 0.0LF;
        return dvec3(number(given.y), number(given.z), number(given.w));
    }
    dvec3 a = corner(triangle, 0), b = corner(triangle, 1), c = corner(triangle, 2);
    dvec3 largest = max(abs(a), max(abs(b), abs(c)));
    shift = max(largest.x, max(largest.y, largest.z));
    precise dvec3 point = a + number(given.y) * (b - a) + number(given.z) * (c - a);
    return point;
}
