// A shadow frustum against a box in the camera's normalized device coordinates (Sintorn et al. 2011, Algorithm 2).
//
// A frustum is 12 rows: the normals of four planes that point inside, the constant parts of their bounds, the parts that
// grow with q; then the same of up to four planes through the eye, whose normals have no q, so that the constant part of
// the bound stands there; then its triangle, as a caster, and the steps of transmission.glsl that it adds to a sum where
// that is the same everywhere. `setup.glsl` makes them and derives the bounds.

const int ROWS = 12;
const float UNPLACED = 3.0;  // x of a sample that does not lie in the picture: no box tells anything about it

// Counters, a row of 32-bit numbers; those of the tests take two.
const int FRUSTA = 0, TASKS = 1, QUEUED = 2, UNDECIDED = 3, TILE_TESTS = 4, SAMPLE_TESTS = 6, ACCEPTS = 8, REJECTS = 10;
const int FRUSTA_GROUPS = 12, TASKS_GROUPS = 15;  // three numbers each, for an indirect dispatch of a group for each
const uint GROUPS_X = 256u;  // of such a dispatch

const int REJECT = 0, ACCEPT = 1, REFINE = 2;

// A triangle, whether what it lets through depends on the place, and the side of it that the light is on.
int caster_of(int triangle, bool uneven, int side) {
    return 4 * triangle + (uneven ? 2 : 0) + (side > 0 ? 1 : 0);
}

int triangle_of(int caster) {
    return caster >> 2;
}

bool is_uneven(int caster) {
    return (caster & 2) == 2;
}

int side_of_light(int caster) {
    return (caster & 1) == 1 ? 1 : -1;
}

struct Frustum {
    vec4 normal[4];
    vec4 bound, bound_q;
#ifdef SILHOUETTE_PLANES
    vec4 outline[4];
    vec4 outline_q;
#endif
};

// Which side a box is surely on; neither for boxes that hold samples outside the picture.
int test(Frustum frustum, vec3 low, vec3 high) {
    if (low.x < -UNPLACED) return REFINE;
    vec3 middle = 0.5 * (low + high), half_width = 0.5 * (high - low);
    bool outside = false, inside = true;
    for (int i = 0; i < 4; i++) {
        vec4 n = frustum.normal[i];
        float value = dot(n.xyw, middle) + n.z, reach = dot(abs(n.xyw), half_width);
        float bound = frustum.bound[i] + frustum.bound_q[i] * high.z;
        outside = outside || value + reach < -bound;
        inside = inside && value - reach > bound;
    }
#ifdef SILHOUETTE_PLANES
    for (int i = 0; i < 4; i++) {
        vec4 n = frustum.outline[i];
        float value = dot(n.xy, middle.xy) + n.z, reach = dot(abs(n.xy), half_width.xy);
        outside = outside || value + reach < -(n.w + frustum.outline_q[i] * high.z);
    }
#endif
    return outside ? REJECT : (inside ? ACCEPT : REFINE);
}
