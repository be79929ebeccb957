// Sides of volumes emitted by a geometry shader.

#ifdef GEOMETRY_SHADER
flat out int weight;

void emit_corner(vec4 position, int side) {
    gl_Position = position;
    weight = side;
    EmitVertex();
}

// The side over the edge from a to b, where a comes before b: its front is outside where the volume's boundary runs from
// a to b (`side` > 0). Always the same vertices in the same order, so that opposite sides cancel to the last bit. Without
// a counter that takes signs, transposed: that keeps the diagonal, but depths may differ in the last bits.
void emit_side(vec3 a, vec3 b, int side) {
    vec4 near_a = project_point(a), near_b = project_point(b), far_a = project_shadow(a), far_b = project_shadow(b);
#ifdef FLOAT_COUNTER
    emit_corner(near_b, side);
    emit_corner(near_a, side);
    emit_corner(far_b, side);
    emit_corner(far_a, side);
    EndPrimitive();
#else
    for (int i = 0; i < abs(side); i++) {
        emit_corner(near_b, side);
        emit_corner(side > 0 ? near_a : far_b, side);
        emit_corner(side > 0 ? far_b : near_a, side);
        emit_corner(far_a, side);
        EndPrimitive();
    }
#endif
}
#endif
