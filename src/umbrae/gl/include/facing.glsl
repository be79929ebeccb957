// The side of a triangle's plane that the light is on: the predicate `facing` of geometry/predicates.py, with the
// same determinant and the same count of roundings. Float32 where its bound allows, else float64. Where that is
// unsure, too, the triangle counts as edge-on and casts nothing: it is thinner, seen from the light, than 2^-48 of
// its size.
//
// Float32 rounds by 2^-24: the derivation there gives 8.1 roundings, 2^-20 has room for those of the bound. What
// underflows loses at most 2^-126 a product, or six times that times d; 2^-120 covers it.

#include "light.glsl"

const float FILTER = 9.5367431640625e-7;  // 2^-20
const float UNDERFLOW = 7.52316384526264e-37;  // 2^-120
const double FILTER_64 = 1.7763568394002505e-15LF;  // 2^-49

int facing_64(vec3 a, vec3 b, vec3 c) {
    dvec3 base = dvec3(a);
    precise dvec3 r = dvec3(b) - base;
    precise dvec3 e = dvec3(c) - base;
    precise dvec3 d = dvec3(light.xyz) - double(light.w) * base;
    precise dvec3 first = r.yzx * e.zxy;
    precise dvec3 second = r.zxy * e.yzx;
    precise dvec3 n = first - second;
    precise double value = n.x * d.x + n.y * d.y + n.z * d.z;
    precise double bound = FILTER_64 * dot(abs(first) + abs(second), abs(d));
    return value > bound ? 1 : (value < -bound ? -1 : 0);
}

int facing(vec3 a, vec3 b, vec3 c) {
    precise vec3 r = b - a;
    precise vec3 e = c - a;
    precise vec3 d = light.xyz - light.w * a;
    precise vec3 first = r.yzx * e.zxy;
    precise vec3 second = r.zxy * e.yzx;
    precise vec3 n = first - second;
    precise float value = n.x * d.x + n.y * d.y + n.z * d.z;
    precise float bound = FILTER * dot(abs(first) + abs(second), abs(d)) + UNDERFLOW * (1.0 + dot(vec3(1.0), abs(d)));
    if (value > bound) return 1;
    if (value < -bound) return -1;
    return facing_64(a, b, c);
}
