// The depth of the view samples, from the distances that came with them.

#ifdef VERTEX_SHADER
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT_SHADER
uniform sampler2D distances;  // along the view direction in world units, infinite for background
uniform float depth_scale;
uniform float world_scale;
uniform float background;  // its depth

void main() {
    float distance = texelFetch(distances, ivec2(gl_FragCoord.xy), 0).r;
    gl_FragDepth = isinf(distance) ? background : depth_scale / (distance * world_scale);
}
#endif
