// A sample lies just off its own triangle, on the side of the eye: that light cap is behind it, whatever depths say.

layout(std430, binding = 0) readonly buffer Caps { int cap_of_primitive[]; };

#ifdef FRAGMENT_SHADER
uniform isampler2D own_cap;  // of each sample

// To be called for every fragment; `primitive` is -1 off the light caps.
void place_cap(int primitive) {
    bool own = primitive >= 0 && cap_of_primitive[primitive] == texelFetch(own_cap, ivec2(gl_FragCoord.xy), 0).r;
#ifdef PUSH_BACK
    // What `push_back` of gl/state.py does to caps that are drawn by themselves.
    float slopes = fwidth(gl_FragCoord.z);
    float rounding = primitive >= 0 ? PUSH_BACK * slopes + 9.5e-7 * gl_FragCoord.z : 0.0;
    gl_FragDepth = own ? 0.0 : gl_FragCoord.z - rounding;
#elif defined(BEHIND)
    gl_FragDepth = own ? 0.0 : gl_FragCoord.z;  // farther than anything
#else
    if (own) discard;
#endif
}
#endif
