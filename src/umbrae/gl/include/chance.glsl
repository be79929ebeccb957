// Chances of samples at triangles: the twin of geometry/chance.py, in pairs of 32 bits, low and high.

const uint STRIDES[16] = uint[16](
    539132281u, 567308789u, 604631369u, 637651891u, 663485161u, 681143423u, 762308179u, 810749237u,
    944479709u, 955424933u, 1001551027u, 1015101827u, 1019508271u, 1043940379u, 1060703011u, 1068840287u
);

uvec2 plus(uvec2 a, uvec2 b) {
    uint carry, low = uaddCarry(a.x, b.x, carry);
    return uvec2(low, a.y + b.y + carry);
}

uvec2 times(uvec2 a, uvec2 b) {
    uint high, low;
    umulExtended(a.x, b.x, high, low);
    return uvec2(low, high + a.x * b.y + a.y * b.x);
}

// The number xor itself, shifted to the right by fewer than 32 bits.
uvec2 folded(uvec2 a, int bits) {
    return a ^ uvec2((a.x >> bits) | (a.y << (32 - bits)), a.y >> bits);
}

uvec2 mixed(uvec2 key) {
    key = plus(key, uvec2(0x7F4A7C15u, 0x9E3779B9u));
    key = times(folded(key, 30), uvec2(0x1CE4E5B9u, 0xBF58476Du));
    key = times(folded(key, 27), uvec2(0x133111EBu, 0x94D049BBu));
    return folded(key, 31);
}

// A number in [0, 1) at a triangle for sample `index` of a picture with up to 65536 `strata` samples in each pixel.
double chance(uvec2 key, int triangle, uint index, uint strata) {
    uvec2 drawn = mixed(mixed(key ^ uvec2(uint(triangle), 0u)) ^ uvec2(index / strata, 0u));
    uint number = index % strata, offset = drawn.y >> 1;
    uint stratum = (number * (STRIDES[drawn.x & 15u] % strata) % strata + offset) % strata;
    uvec2 bits = mixed(drawn ^ uvec2(number, 0u));
    precise double within = (double(bits.y >> 11) * 4294967296.0LF + double((bits.y << 21) | (bits.x >> 11)))
        * 1.1102230246251565e-16LF;  // 2^-53
    precise double found = (double(stratum) + within) / double(strata);
    return min(found, 0.99999999999999988898LF);  // 1 - 2^-53
}
