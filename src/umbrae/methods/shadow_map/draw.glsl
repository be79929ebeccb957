// The depth of what the light sees: reversed, 0 at the far end of the map.

uniform mat4 to_map;

#ifdef VERTEX_SHADER
in vec3 position;

void main() {
    gl_Position = to_map * vec4(position, 1.0);
}
#endif

#ifdef FRAGMENT_SHADER
void main() {}
#endif
