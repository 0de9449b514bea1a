//! The names of all glTF extensions that are known here, each spelled once. What is known of them stands in
//! `gltf/extensions.rs`.

pub(crate) const ADOBE_MATERIALS_CLEARCOAT_SPECULAR: &str = "ADOBE_materials_clearcoat_specular";
pub(crate) const ADOBE_MATERIALS_THIN_TRANSPARENCY: &str = "ADOBE_materials_thin_transparency";
pub(crate) const EXT_LIGHTS_IMAGE_BASED: &str = "EXT_lights_image_based";
pub(crate) const EXT_MATERIALS_BUMP: &str = "EXT_materials_bump";
pub(crate) const EXT_MESH_FEATURES: &str = "EXT_mesh_features";
pub(crate) const EXT_MESH_GPU_INSTANCING: &str = "EXT_mesh_gpu_instancing";
pub(crate) const EXT_MESHOPT_COMPRESSION: &str = "EXT_meshopt_compression";
pub(crate) const EXT_TEXTURE_AVIF: &str = "EXT_texture_avif";
pub(crate) const EXT_TEXTURE_WEBP: &str = "EXT_texture_webp";
pub(crate) const FB_GEOMETRY_METADATA: &str = "FB_geometry_metadata";
pub(crate) const GODOT_SINGLE_ROOT: &str = "GODOT_single_root";
pub(crate) const KHR_ANIMATION_POINTER: &str = "KHR_animation_pointer";
pub(crate) const KHR_DRACO_MESH_COMPRESSION: &str = "KHR_draco_mesh_compression";
pub(crate) const KHR_LIGHTS_PUNCTUAL: &str = "KHR_lights_punctual";
pub(crate) const KHR_MATERIALS_ANISOTROPY: &str = "KHR_materials_anisotropy";
pub(crate) const KHR_MATERIALS_CLEARCOAT: &str = "KHR_materials_clearcoat";
pub(crate) const KHR_MATERIALS_EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";
pub(crate) const KHR_MATERIALS_IOR: &str = "KHR_materials_ior";
pub(crate) const KHR_MATERIALS_SHEEN: &str = "KHR_materials_sheen";
pub(crate) const KHR_MATERIALS_SPECULAR: &str = "KHR_materials_specular";
pub(crate) const KHR_MATERIALS_TRANSMISSION: &str = "KHR_materials_transmission";
pub(crate) const KHR_MATERIALS_VARIANTS: &str = "KHR_materials_variants";
pub(crate) const KHR_MESH_QUANTIZATION: &str = "KHR_mesh_quantization";
pub(crate) const KHR_MESHOPT_COMPRESSION: &str = "KHR_meshopt_compression";
pub(crate) const KHR_NODE_HOVERABILITY: &str = "KHR_node_hoverability";
pub(crate) const KHR_NODE_SELECTABILITY: &str = "KHR_node_selectability";
pub(crate) const KHR_NODE_VISIBILITY: &str = "KHR_node_visibility";
pub(crate) const KHR_TEXTURE_BASISU: &str = "KHR_texture_basisu";
pub(crate) const KHR_TEXTURE_TRANSFORM: &str = "KHR_texture_transform";
pub(crate) const KHR_XMP: &str = "KHR_xmp";
pub(crate) const KHR_XMP_JSON_LD: &str = "KHR_xmp_json_ld";
pub(crate) const MSFT_LOD: &str = "MSFT_lod";
pub(crate) const MSFT_PACKING_NORMAL_ROUGHNESS_METALLIC: &str = "MSFT_packing_normalRoughnessMetallic";
pub(crate) const MSFT_PACKING_OCCLUSION_ROUGHNESS_METALLIC: &str = "MSFT_packing_occlusionRoughnessMetallic";
pub(crate) const MSFT_SCREENCOVERAGE: &str = "MSFT_screencoverage";
pub(crate) const MSFT_TEXTURE_DDS: &str = "MSFT_texture_dds";

/// What the names of all extensions of materials by Khronos begin with.
pub(crate) const KHR_MATERIALS: &str = "KHR_materials_";
