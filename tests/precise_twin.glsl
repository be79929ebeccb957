// What the driver makes of `precise`: a product less its own rounding. Contracted into one operation it is the error of
// the rounding, else zero.

#ifdef COMPUTE_SHADER
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Factors { float factors[]; };
layout(std430, binding = 1) writeonly buffer Rests { float rests[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= count) return;
    float a = factors[2 * i], b = factors[2 * i + 1];
    precise float product = a * b;
    precise float rest = a * b - product;
    rests[i] = rest;
}
#endif
