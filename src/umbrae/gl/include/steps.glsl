// Products of shares of light as sums of their -log: whole numbers in steps of 2^-26, so that their order does not matter.
// A share below e^-16 counts as that, a sum beyond 32 as 32, and a share of zero makes the sum OPAQUE for good.

const uint OPAQUE = 0xffffffffu, LARGEST = 0x80000000u;
const double STEP = 1.4901161193847656e-08LF;  // 2^-26

// -log of a share in steps. With m 2^e, m from 1 to 2, and s = (m / c - 1) / (m / c + 1), c = sqrt(2), |s| < 0.172:
// log = e log 2 + log c + 2 (s + s^3 / 3 + ... + s^9 / 9) but for 2 s^11 / 11 < 2^-30, a sixteenth of a step.
uint steps_of(double share) {
    if (share <= 0.0LF) return OPAQUE;
    if (share >= 1.0LF) return 0u;
    uvec2 bits = unpackDouble2x32(share);
    int exponent = int(bits.y >> 20) - 1023;
    double m = packDouble2x32(uvec2(bits.x, (bits.y & 0x000fffffu) | 0x3ff00000u)) * 0.70710678118654752LF;
    double s = (m - 1.0LF) / (m + 1.0LF), square = s * s;
    double series = 1.0LF + square * (1.0LF / 3.0LF + square * (0.2LF + square * (1.0LF / 7.0LF + square / 9.0LF)));
    double log_of = (double(exponent) + 0.5LF) * 0.69314718055994531LF + 2.0LF * s * series;
    return uint(clamp(-log_of, 0.0LF, 16.0LF) / STEP + 0.5LF);
}

// Two sums, or a sum and a summand.
uint sum_of(uint a, uint b) {
    if (a == OPAQUE || b == OPAQUE) return OPAQUE;
    return a > LARGEST - b ? LARGEST : a + b;
}
