// Samples as a tree of tiles with 32 children each: `methods/frustum_gl/tiles.py`. In pictures they lie 8 x 4 and 4 x 8 in
// turns; a list is a picture of one row, with 32 x 1 children.
//
// Level 0 are the samples; a node's number counts row by row through its level. What is kept for nodes stands by
// parents, 32 children one after another: the place of a child is 32 times its parent's number plus its `lane`.

const int MAX_LEVELS = 9;

uniform ivec4 levels[MAX_LEVELS];  // of each level: width and height in nodes, first word, first place of its nodes
uniform int depth;  // level of the root, which is alone there
uniform ivec2 tile_bits[2];  // how children lie, as powers of two, at even levels and at odd ones
uniform ivec4 pixels;  // width of the picture, samples per pixel, and how these lie in x and in y

// How the children of a node at this level lie.
ivec2 bits_of(int level) {
    return tile_bits[level & 1];
}

ivec2 child_of(int level, ivec2 node, uint lane) {
    ivec2 bits = bits_of(level);
    return (node << bits) + ivec2(int(lane) & ((1 << bits.x) - 1), int(lane) >> bits.x);
}

// The parent of a node at this level, and the node's lane there.
ivec2 parent_of(int level, ivec2 node, out int lane) {
    ivec2 bits = bits_of(level + 1), rest = node & ((ivec2(1) << bits) - 1);
    lane = (rest.y << bits.x) + rest.x;
    return node >> bits;
}

bool exists(int level, ivec2 node) {
    return all(lessThan(node, levels[level].xy));
}

int number_of(int level, ivec2 node) {
    return node.y * levels[level].x + node.x;
}

ivec2 node_of(int level, int index) {
    return ivec2(index % levels[level].x, index / levels[level].x);
}

// Where what is kept for a node stands.
int place_of(int level, ivec2 node) {
    int lane;
    ivec2 parent = parent_of(level, node, lane);
    return levels[level].w + 32 * number_of(level + 1, parent) + lane;
}

// The sample at a node of level 0, in the order of the arrays.
int sample_of(ivec2 node) {
    ivec2 pixel = node / pixels.zw, rest = node - pixel * pixels.zw;
    return (pixel.y * pixels.x + pixel.x) * pixels.y + rest.y * pixels.z + rest.x;
}

ivec2 node_of_sample(int index) {
    int pixel = index / pixels.y, rest = index - pixel * pixels.y;
    return ivec2(pixel % pixels.x, pixel / pixels.x) * pixels.zw + ivec2(rest % pixels.z, rest / pixels.z);
}
