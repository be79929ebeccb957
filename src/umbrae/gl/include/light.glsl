uniform vec4 light;  // homogeneous, in the units of the positions
