// Samples looked up in the map: how many of TAPS x TAPS texels around each hold something nearer to the light.

#include "invocation.glsl"

#ifdef COMPUTE_SHADER
layout(std430, binding = 0) readonly buffer Positions { float positions[]; };
layout(std430, binding = 1) buffer Darkness { uint darkness[]; };

uniform sampler2D map;
uniform mat4 to_map;
uniform vec4 nearer;  // what the constant bias adds to clip coordinates
uniform float own;  // samples beyond are another map's
uniform int count;

void main() {
    int at = invocation();
    if (at >= count) return;
    vec4 clip = to_map * vec4(positions[3 * at], positions[3 * at + 1], positions[3 * at + 2], 1.0);
    if (clip.w <= 0.0 || any(greaterThan(abs(clip.xy), vec2(own * clip.w)))) return;  // not of this map
    uint dark = 0u;
    vec4 moved = clip + nearer;
    if (moved.w > 0.0) {
        // Beyond the far end there is nothing but what the map shows.
        float depth = max(moved.z / moved.w, 0.0);
        int size = textureSize(map, 0).x;
        // Row 0 is the top row (see gl/context.py).
        vec2 place = (0.5 + vec2(0.5, -0.5) * clip.xy / clip.w) * float(size) - 0.5 * float(TAPS - 1);
        ivec2 corner = ivec2(floor(place));
        for (int row = 0; row < TAPS; row++) {
            for (int column = 0; column < TAPS; column++) {
                ivec2 texel = clamp(corner + ivec2(column, row), ivec2(0), ivec2(size - 1));
                dark += texelFetch(map, texel, 0).r > depth ? 1u : 0u;
            }
        }
    }
    darkness[at] = dark;
}
#endif
