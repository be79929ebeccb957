// The number of a compute shader's invocation: 64 in a group, and groups in rows, as there is a limit to each side.

#ifdef COMPUTE_SHADER
layout(local_size_x = 64) in;

int invocation() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return int(group * gl_WorkGroupSize.x + gl_LocalInvocationID.x);
}

int invocations() {
    return int(gl_NumWorkGroups.x * gl_NumWorkGroups.y * gl_WorkGroupSize.x);
}
#endif
