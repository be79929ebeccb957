// The triangles of a scene and the samples on them, in buffers.

#include "predicates.glsl"

layout(std430, binding = 0) readonly buffer Positions { uint positions[]; };
layout(std430, binding = 1) readonly buffer Triangles { int triangles[]; };
layout(std430, binding = 3) readonly buffer Own { int own[]; };  // each sample's triangle; -1: background
layout(std430, binding = 4) readonly buffer Barycentrics { uvec2 barycentrics[]; };

layout(std430, binding = 5) readonly buffer Sides { uint sides[]; };  // that samples are seen from, four a word

int side_of(int sample_index) {
    return bitfieldExtract(int(sides[sample_index >> 2]), 8 * (sample_index & 3), 8);
}

dvec3 corner(int triangle, int which) {
    int vertex = 3 * triangles[3 * triangle + which];
    return dvec3(number(positions[vertex]), number(positions[vertex + 1]), number(positions[vertex + 2]));
}

// The sample's position, off by at most 2^-49 `shift`: `surface_point` of geometry/predicates.py.
dvec3 surface_point(int sample_index, out double shift) {
    int triangle = own[sample_index];
    dvec3 a = corner(triangle, 0), b = corner(triangle, 1), c = corner(triangle, 2);
    dvec3 largest = max(abs(a), max(abs(b), abs(c)));
    shift = max(largest.x, max(largest.y, largest.z));
    uvec2 uv = barycentrics[sample_index];
    precise dvec3 point = a + number(uv.x) * (b - a) + number(uv.y) * (c - a);
    return point;
}
