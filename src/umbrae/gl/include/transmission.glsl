// What triangles let through: the twin of `passing` in transmission.py and of `fetch` in geometry/texture.py, in float64.

#include "soup.glsl"

const int SOLID = 0, CLEAR = 1, EVEN = 2, VARYING = 3;
const int MATERIAL_ROW = 16, LINEAR_ROWS = 256;

layout(std430, binding = 16) readonly buffer Surfaces { int surfaces[]; };  // of each triangle: 4 material + kind
// Linear light of the 256 values of a texture first, then rows: base colour and alpha, what is transmitted, alpha cutoff,
// alpha mode (0 opaque, 1 mask, 2 blend), first texel or -1, height, width, what passes where that is even.
layout(std430, binding = 17) readonly buffer Materials { double materials[]; };
layout(std430, binding = 18) readonly buffer Uvs { uvec2 uvs[]; };
layout(std430, binding = 19) readonly buffer Colors { uvec4 colors[]; };
layout(std430, binding = 20) readonly buffer Texels { uint texels[]; };
uniform bool colored;  // whether there are vertex colours

int kind_of(int triangle) {
    return surfaces[triangle] & 3;
}

// Where the row of a triangle's material begins.
int material_of(int triangle) {
    return LINEAR_ROWS + MATERIAL_ROW * (surfaces[triangle] >> 2);
}

dvec4 texel(int index) {
    uvec4 bytes = (uvec4(texels[index]) >> uvec4(0, 8, 16, 24)) & 255u;
    return dvec4(materials[bytes.x], materials[bytes.y], materials[bytes.z], double(bytes.w));
}

// Linear colour and alpha of a texture at uv, bilinear and repeated.
dvec4 fetch(int first, int height, int width, dvec2 uv) {
    precise dvec2 at = (uv - floor(uv)) * dvec2(width, height) - 0.5LF;
    ivec2 low = ivec2(floor(at)), high = low + 1;
    precise dvec2 part = at - dvec2(low);
    if (high.x == width) high.x = 0;
    if (high.y == height) high.y = 0;
    if (low.x < 0) low.x = width - 1;
    if (low.y < 0) low.y = height - 1;
    precise dvec4 found = (1.0LF - part.x) * (1.0LF - part.y) * texel(first + low.y * width + low.x)
        + part.x * (1.0LF - part.y) * texel(first + low.y * width + high.x)
        + (1.0LF - part.x) * part.y * texel(first + high.y * width + low.x)
        + part.x * part.y * texel(first + high.y * width + high.x);
    return dvec4(found.xyz, found.w / 255.0LF);
}

// What a triangle of kind VARYING lets through at a place with these barycentrics.
dvec3 passing(int triangle, dvec3 weights) {
    int m = material_of(triangle);
    ivec3 v = ivec3(triangles[3 * triangle], triangles[3 * triangle + 1], triangles[3 * triangle + 2]);
    precise dvec4 color = dvec4(materials[m], materials[m + 1], materials[m + 2], materials[m + 3]);
    int first = int(materials[m + 7]);
    if (first >= 0) {
        precise dvec2 uv = dvec2(0.0LF);
        for (int i = 0; i < 3; i++) uv += weights[i] * dvec2(number(uvs[v[i]].x), number(uvs[v[i]].y));
        color *= fetch(first, int(materials[m + 8]), int(materials[m + 9]), uv);
    }
    if (colored) {
        precise dvec4 tint = dvec4(0.0LF);
        for (int i = 0; i < 3; i++) {
            uvec4 c = colors[v[i]];
            tint += weights[i] * dvec4(number(c.x), number(c.y), number(c.z), number(c.w));
        }
        color *= tint;
    }
    double mode = materials[m + 6];
    double alpha = mode == 0.0LF ? 1.0LF : (mode == 1.0LF ? (color.w >= materials[m + 5] ? 1.0LF : 0.0LF) : color.w);
    return dvec3(1.0LF - alpha) + alpha * materials[m + 4] * color.xyz;
}

// What any triangle lets through there.
dvec3 share_of(int triangle, dvec3 weights) {
    int kind = kind_of(triangle), m = material_of(triangle);
    if (kind == VARYING) return passing(triangle, weights);
    if (kind == EVEN) return dvec3(materials[m + 10], materials[m + 11], materials[m + 12]);
    return dvec3(kind == CLEAR ? 1.0LF : 0.0LF);
}
