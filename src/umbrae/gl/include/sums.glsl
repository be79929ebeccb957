// Sums of what casters let through, red, green and blue, for each place of a sample and then of a node of the tree.

#include "steps.glsl"
#include "tiles.glsl"

layout(std430, binding = 21) coherent buffer Sums { uint sums[]; };

// Where the sums of the nodes at a level begin.
int first_sum(int level) {
    return level == 0 ? 0 : 96 * levels[1].x * levels[1].y;
}

// Add to a sum while others do so as well.
void add_steps(int at, uint steps) {
    uint before = sums[at];
    while (steps != 0u) {
        uint found = atomicCompSwap(sums[at], before, sum_of(before, steps));
        if (found == before) break;
        before = found;
    }
}

// Let a triangle with these shares dim the light of a sample, and of its place.
void dim(int place, int sample_index, int triangle, dvec3 share) {
    for (int i = 0; i < 3; i++) add_steps(3 * place + i, steps_of(share[i]));
}

// What arrives of a channel at a place.
float arriving(int place, int channel) {
    uint sum = sums[3 * place + channel];
    return sum == OPAQUE ? 0.0 : exp(float(double(sum) * -STEP));
}
