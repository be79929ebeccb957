// Where the samples lie in the camera's normalized device coordinates, tile by tile.
//
// (x, y) are those of the picture and q = `unit` / W, with W the distance along the view direction. A plane of space is
// one there, W times as far: N . (P - V) = W (n . (x, y, 1, q)).

#include "soup.glsl"
#include "tiles.glsl"
#include "frustum.glsl"
#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 6) writeonly buffer Places { uvec4 places[]; };  // bits of x, y, q, and the own triangle
uniform dvec3 eye;
uniform dvec3 rows[3];  // from P - eye to X, Y, W
uniform double unit;
uniform int count;

void main() {
    int slot = invocation();
    if (slot >= count) return;
    ivec2 node = child_of(1, node_of(1, slot / 32), uint(slot) % 32u);
    int triangle = exists(0, node) ? own_of(sample_of(node)) : BACKGROUND;
    if (triangle == BACKGROUND) {
        places[slot] = uvec4(0u, 0u, 0u, uint(BACKGROUND));
        return;
    }
    double shift;
    dvec3 relative = surface_point(sample_of(node), shift) - eye;
    double w = dot(rows[2], relative);
    vec3 place = vec3(dvec3(dot(rows[0], relative), dot(rows[1], relative), unit) / w);
    // Sampling may bring a point anywhere on a triangle that is very large or passes by the eye: see `UNPLACED`.
    bool placed = w > 0.0LF && abs(place.x) <= 2.0 && abs(place.y) <= 2.0 && place.z <= 1e30;
    places[slot] = uvec4(floatBitsToUint(placed ? place : vec3(UNPLACED, 0.0, 0.0)), uint(triangle));
}
#endif
