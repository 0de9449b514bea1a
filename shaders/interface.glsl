// What host and shaders share. src/verify/vulkan/interface.rs has the same structures, and a test compares offsets.

#extension GL_EXT_ray_tracing : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

struct Ray {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

struct Hit {
    // Distance in lengths of the ray's direction; negative for a miss.
    float t;
    // Custom index of the instance.
    uint entry;
    // Geometry of the BLAS.
    uint geometry;
    // Triangle of the geometry.
    uint primitive;
    // 1 where the front is seen.
    uint front;
    // Times a triangle was found that may let the ray through.
    uint any_hits;
};

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Rays {
    Ray ray[];
};

layout(buffer_reference, std430, buffer_reference_align = 8) writeonly buffer Hits {
    Hit hit[];
};

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Distances {
    uint distance[];
};

struct Clocked {
    // Ticks of the device's clock, at most the largest number of 32 bits.
    uint ticks;
    // 1 where something is hit.
    uint is_hit;
};

layout(buffer_reference, std430, buffer_reference_align = 8) writeonly buffer Ticks {
    Clocked ray[];
};

layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Words {
    uint word[];
};

layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Texcoords {
    vec2 texcoord[];
};

struct AlphaGeometry {
    // Three vertices a triangle.
    Words triangles;
    // By vertex.
    Texcoords texcoords;
    // A byte each; null where alpha is 1.
    Words texels;
    // Texels by axis.
    uvec2 size;
    // Beyond 0 to 1, by axis: 0 repeats, 1 clamps, 2 mirrors.
    uvec2 wrap;
    float factor;
    // Smallest product of texel and factor that counts as a hit.
    float cutoff;
};

layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer AlphaGeometries {
    AlphaGeometry geometry[];
};

layout(push_constant, std430) uniform Work {
    // Address of the TLAS.
    uvec2 scene;
    Rays rays;
    // Address of Hits, Distances or Ticks.
    uvec2 results;
    // The first ray of this launch.
    uint first;
    // Ray flags of every ray.
    uint ray_flags;
    // Units of the structures a unit of the rays: a power of two.
    float scale;
    // Hits kept per ray, where all are.
    uint kept_hits;
    // Null where nothing is tested.
    AlphaGeometries alpha;
    // For each entry the first of its geometries.
    Words first_geometries;
} work;
