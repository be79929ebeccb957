// The samples: each its own triangle and, on a surface, the bits of two barycentrics and the side it is seen from; else
// those of a free point's position. `passes.py` of methods/frustum_gl fills the buffer.

layout(std430, binding = 3) readonly buffer Samples { uvec4 samples[]; };

const int BACKGROUND = -1, FREE = -2;  // in place of the own triangle

int own_of(int sample_index) {
    return int(samples[sample_index].x);
}

// Of a sample on a surface.
int side_of(int sample_index) {
    return int(samples[sample_index].w);
}
