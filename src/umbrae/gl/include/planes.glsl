// Planes of space in the camera's normalized device coordinates, with bounds of what float32 makes of them.
//
// A point is P = eye + W (F + x R + y U), where R, U, F are the columns that invert `rows` of methods/frustum_gl/place.glsl. So
//
//     N . (P - V) / W = (N . R) x + (N . U) y + N . F + q (N . (eye - V)) / unit = n . (x, y, 1, q).
//
// How far off may the value be that float32 finds at a box's centre, and its half-width there? Let S be the sum of the
// magnitudes of the four summands, with |x|, |y| <= 2 and the box's largest q, and D = |F| + 2 |R| + 2 |U| componentwise.
// - Float32: n and the coordinates are rounded once each (up to 2^-23 where conversion cuts), centre and half-width once
//   more, then four products and three sums: less than 20 steps of 2^-24 on any path, for centre and half-width together.
//   2^-19 S has room for what rounding does to the bound itself.
// - Float64: N is a cross product of differences; with p the sum of its permanents |r_y e_z| + |r_z e_y|, each component
//   is off by less than 2^-50 p, and so are the scalar products with R, U, F and eye - V. A sample's position is off by
//   2^-49 M, with M the largest coordinate (see `surface_point`), its place by a few roundings of |P - eye| <= W |D|. All
//   of that is less than 2^-43 p (D_x + D_y + D_z) + 2^-48 p (|eye - V|_max + M) q / unit.
// - Underflow: n is scaled so that its largest component is 1; what falls below 2^-126 is covered by 2^-100.

uniform dvec3 eye;
uniform dvec3 columns[3];  // R, U, F
uniform double unit, reach;  // of q; the largest coordinate

const double ROUNDING = 1.9073486328125e-06LF;  // 2^-19
const double PLACED = 1.1368683772161603e-13LF;  // 2^-43
const double MEASURED = 3.552713678800501e-15LF;  // 2^-48
const double UNDERFLOW = 7.888609052210118e-31LF;  // 2^-100

struct Plane {
    vec4 normal;
    vec2 bound;  // constant, and of q
};

// The plane through `base` with this normal; inside is where it points to.
Plane plane(dvec3 normal, double permanent, dvec3 offset) {
    dvec3 spread = abs(columns[2]) + 2.0LF * (abs(columns[0]) + abs(columns[1]));
    dvec4 n = dvec4(dot(normal, columns[0]), dot(normal, columns[1]), dot(normal, columns[2]), dot(normal, offset) / unit);
    double largest = max(max(abs(n.x), abs(n.y)), max(abs(n.z), abs(n.w)));
    double far = max(abs(offset.x), max(abs(offset.y), abs(offset.z))) + reach;
    double flat_bound = ROUNDING * (2.0LF * (abs(n.x) + abs(n.y)) + abs(n.z));
    flat_bound += PLACED * permanent * (spread.x + spread.y + spread.z);
    double deep_bound = ROUNDING * abs(n.w) + MEASURED * permanent * far / unit;
    // Nothing is left of a normal that is zero; its bound is then too large for any decision.
    double scale = 1.0LF / max(largest, 1e-300LF);
    dvec2 bound = min(dvec2(flat_bound, deep_bound) * scale + dvec2(UNDERFLOW), dvec2(1e30LF));
    return Plane(vec4(n * scale), vec2(bound));
}

// The normal r x e times `sign`, off the eye by `offset`.
Plane plane_across(dvec3 r, dvec3 e, double sign, dvec3 offset) {
    dvec3 one = r.yzx * e.zxy, two = r.zxy * e.yzx, permanents = abs(one) + abs(two);
    return plane(sign * (one - two), permanents.x + permanents.y + permanents.z, offset);
}
