// Light that chance stops: a bit for each sample and channel, set with the probability that a caster stops light of that
// channel (Sintorn et al., section 3.2). Bits are only ever set, and chances do not depend on the order of the work.

#include "chance.glsl"
#include "tiles.glsl"

layout(std430, binding = 4) readonly buffer Numbers { uint numbers[]; };  // of samples among all that were given
layout(std430, binding = 21) coherent buffer Bits { uint stopped[]; };  // for 32 places: of red, green, blue
uniform uvec2 key;

// Let a triangle with these shares dim the light of a sample, and of its place.
void dim(int place, int sample_index, int triangle, dvec3 share) {
    double drawn = chance(key, triangle, numbers[sample_index], uint(pixels.y));
    for (int i = 0; i < 3; i++) {
        if (drawn < 1.0LF - share[i]) atomicOr(stopped[3 * (place / 32) + i], 1u << (place % 32));
    }
}

// What arrives of a channel at a place.
float arriving(int place, int channel) {
    return (stopped[3 * (place / 32) + channel] >> (place % 32) & 1u) == 1u ? 0.0 : 1.0;
}
