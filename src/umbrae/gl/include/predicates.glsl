// The predicate of geometry/predicates.py in float64: the same determinants, vertices in the same order, and the same
// bounds of their errors, derived there. What a value below its bound means is for the caller to find out exactly.
//
// Coordinates come as the bits of float32 numbers in the units of the scene. Drivers may take numbers below 2^-126 for
// zero; read by their bits all of them are exact, and float64 neither overflows nor underflows with them.

uniform dvec4 light;  // homogeneous, holding float32 numbers

const double FILTER = 1.7763568394002505e-15LF;  // 2^-49
const int UNSURE = 2, CULLED = -2;

// The float32 number with these bits.
double number(uint bits) {
    uint magnitude = bits & 0x7fffffffu;
    // Below 2^-126 its last 23 bits count steps of 2^-149.
    double value = magnitude < 0x00800000u ? double(magnitude) * 1.401298464324817e-45LF : double(uintBitsToFloat(magnitude));
    return (bits >> 31) == 0u ? value : -value;
}

// (r x e) . d, and a bound of its error, where d may be off by 2^-49 `shift` in each component.
dvec2 determinant_of(dvec3 r, dvec3 e, dvec3 d, double shift) {
    precise dvec3 first = r.yzx * e.zxy;
    precise dvec3 second = r.zxy * e.yzx;
    precise dvec3 normal = first - second;
    precise double value = normal.x * d.x + normal.y * d.y + normal.z * d.z;
    precise double bound = FILTER * dot(abs(first) + abs(second), abs(d) + dvec3(shift));
    return dvec2(value, bound);
}

// Whether a comes after b in lexicographic order.
bool after(dvec3 a, dvec3 b) {
    if (a.x != b.x) return a.x > b.x;
    return a.y != b.y ? a.y > b.y : a.z > b.z;
}

// The side plane through the light and the edge from a to b, at a point whose coordinates are off by 2^-49 `shift`.
dvec2 side_value(dvec3 a, dvec3 b, dvec3 point, double shift) {
    bool turned = after(a, b);
    dvec3 first = turned ? b : a, second = turned ? a : b;
    dvec2 found = determinant_of(light.w * first - light.xyz, second - first, point - first, shift);
    return turned ? dvec2(-found.x, found.y) : found;
}

// The triangle's own plane at the point.
dvec2 plane_value(dvec3 a, dvec3 b, dvec3 c, dvec3 point, double shift) {
    return determinant_of(b - a, c - a, point - a, shift);
}

// The side of the triangle's plane that the light is on: 1, -1, 0 where it is edge-on, or UNSURE. A bound of zero means
// that all products are zero.
int facing(dvec3 a, dvec3 b, dvec3 c) {
    dvec2 found = determinant_of(b - a, c - a, light.xyz - light.w * a, 0.0LF);
    if (found.x > found.y) return 1;
    if (found.x < -found.y) return -1;
    return found.y == 0.0LF ? 0 : UNSURE;
}
