// Which hits of alpha-tested materials count.

const uint CLAMP = 1u;
const uint MIRROR = 2u;

// A texture coordinate as a place from 0 to 1.
float wrapped(float x, uint mode) {
    if (mode == CLAMP) {
        return clamp(x, 0.0, 1.0);
    }
    if (mode == MIRROR) {
        float twice = x - 2.0 * floor(0.5 * x);
        return min(twice, 2.0 - twice);
    }
    return x - floor(x);
}

// The nearest texel.
uint texel_at(float x, uint mode, uint size) {
    return min(uint(wrapped(x, mode) * float(size)), size - 1u);
}

float alpha_of(AlphaGeometry geometry, uint triangle, vec2 barycentrics) {
    vec2 corners[3];
    for (uint i = 0u; i < 3u; ++i) {
        corners[i] = geometry.texcoords.texcoord[geometry.triangles.word[3u * triangle + i]];
    }
    vec2 place = (1.0 - barycentrics.x - barycentrics.y) * corners[0]
        + barycentrics.x * corners[1] + barycentrics.y * corners[2];
    uint x = texel_at(place.x, geometry.wrap.x, geometry.size.x);
    uint y = texel_at(place.y, geometry.wrap.y, geometry.size.y);
    uint texel = y * geometry.size.x + x;
    // Four texels a word: bytes in memory would be an optional feature.
    return float(bitfieldExtract(geometry.texels.word[texel >> 2], int(8u * (texel & 3u)), 8)) / 255.0;
}

bool is_null(uvec2 address) {
    return all(equal(address, uvec2(0u)));
}

// Whether a hit counts.
bool counts(uint entry, uint index, uint triangle, vec2 barycentrics) {
    if (is_null(uvec2(work.alpha))) {
        return true;
    }
    AlphaGeometry geometry = work.alpha.geometry[work.first_geometries.word[entry] + index];
    float alpha = is_null(uvec2(geometry.texels)) ? 1.0 : alpha_of(geometry, triangle, barycentrics);
    return geometry.factor * alpha >= geometry.cutoff;
}
