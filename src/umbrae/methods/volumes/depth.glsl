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

void main() {
    gl_FragDepth = depth_scale / (texelFetch(distances, ivec2(gl_FragCoord.xy), 0).r * world_scale);
}
#endif
