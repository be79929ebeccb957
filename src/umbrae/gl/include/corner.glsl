// The vertex shader of programs that make volumes later in the pipeline: the point as it is, and its number, which in the
// welded order compares like its position.

#ifdef VERTEX_SHADER
in vec3 position;
out vec3 corner;
flat out int vertex;

void main() {
    corner = position;
    vertex = gl_VertexID;
}
#endif
