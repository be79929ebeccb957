// From the scene to the picture. Positions are relative to the eye before anything else is done with them: the
// difference of two float32 is rounded once, so what is near the eye keeps its digits. Depth is reversed with an
// infinite far plane: z / w = depth_scale / distance, 0 at infinity.

#include "light.glsl"

uniform vec3 eye_high;  // the eye as the sum of two float32
uniform vec3 eye_low;
uniform vec3 picture_x;  // clip coordinates from the direction: rows of the projection
uniform vec3 picture_y;
uniform vec3 forward;
uniform float depth_scale;
uniform vec4 far_plane;  // where volumes may end: points with dot(xyz, p) = w; zero: at infinity

vec4 project(vec3 v, float w) {
    precise vec4 clip;
    clip.x = picture_x.x * v.x + picture_x.y * v.y + picture_x.z * v.z;
    clip.y = picture_y.x * v.x + picture_y.y * v.y + picture_y.z * v.z;
    clip.z = depth_scale * w;
    clip.w = forward.x * v.x + forward.y * v.y + forward.z * v.z;
    return clip;
}

vec4 project_point(vec3 point) {
    precise vec3 v = (point - eye_high) - eye_low;
    return project(v, 1.0);
}

// The point pushed away from the light: to infinity (Milet et al., Equation 2, for w = 0 too: w p - l), or to the far
// plane, which is perpendicular to an axis.
vec4 project_shadow(vec3 point) {
    precise vec3 away = light.w * point - light.xyz;
    if (far_plane.xyz == vec3(0.0)) return project(away, 0.0);
    precise float far = (far_plane.w - dot(far_plane.xyz, point)) / dot(far_plane.xyz, away);
    precise vec3 v = ((point - eye_high) - eye_low) + far * away;
    return project(v, 1.0);
}
