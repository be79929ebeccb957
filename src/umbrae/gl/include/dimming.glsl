// What casters let through on the way to the samples: sums of logarithms, or bits where chance decides.
// To be included after tiles.glsl, which both of them bring as well.

#ifdef BY_CHANCE
#include "bits.glsl"
#else
#include "sums.glsl"
#endif
