// What a fragment of a volume's face adds to the counter.

#ifdef FRAGMENT_SHADER
#ifdef FLOAT_COUNTER
flat in int weight;  // of the face, as often as it lies there; its sign is the face's winding
uniform float entering;  // what a front face of weight 1 adds
out float count;

void count_face() {
#ifdef EVERY_FACE
    count = weight == 0 ? 0.0 : 1.0;  // asked, so that no vertex attribute drops out of the program
#else
    count = entering * float(gl_FrontFacing ? weight : -weight);
#endif
}
#else
void count_face() {}  // the stencil operations count, the winding is in the vertices
#endif
#endif
