// What one opposite vertex adds to the multiplicity of an edge from a to b, where a comes before b in the order of
// the welded vertices: that is the order of their positions (Milet et al., Algorithm 2), so it is an order of indices.

#include "facing.glsl"

// On which side of the plane through the light and the edge the opposite vertex lies, in float32 as it comes.
int opposite_side(vec3 a, vec3 b, vec3 o) {
    vec3 toward = light.xyz - light.w * a;
    return int(sign(dot(cross(toward, b - a), o - a)));
}

#if DETERMINISM == REFERENCE_EDGE
// Decided once for the triangle, with its vertices in order, whichever edge asks (Algorithms 3 and 4). The boundary
// of the ordered triangle runs along its edges upwards, but for the one from its first vertex to its last.
int contribution(int a_id, int b_id, int o_id, vec3 a, vec3 b, vec3 o) {
    // Put in order before the one call: drivers without jumps pay for every call they see.
    vec3 p = a, q = b, r = o;
    int sign_of_edge = 1;
    if (o_id < a_id) { p = o; q = a; r = b; }
    else if (o_id < b_id) { q = o; r = b; sign_of_edge = -1; }
    return sign_of_edge * facing(p, q, r);
}
#elif DETERMINISM == THREE_EDGE
// Asked at all three edges; a triangle whose answers differ is dropped (Peciva et al. 2013).
int contribution(int a_id, int b_id, int o_id, vec3 a, vec3 b, vec3 o) {
    vec3 p = a, q = b, r = o;
    int sign_of_edge = 1;
    if (o_id < a_id) { p = o; q = a; r = b; }
    else if (o_id < b_id) { q = o; r = b; sign_of_edge = -1; }
    int first = opposite_side(p, q, r), second = opposite_side(q, r, p), third = -opposite_side(p, r, q);
    return first == second && second == third ? sign_of_edge * first : 0;
}
#elif DETERMINISM == NONE
// Asked anew at every edge (Kim et al. 2008).
int contribution(int a_id, int b_id, int o_id, vec3 a, vec3 b, vec3 o) {
    return opposite_side(a, b, o);
}
#endif
