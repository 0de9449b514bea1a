//! Reads the inputs of the alpha test of a material.

use glam::{DAffine2, DMat2, DVec2};

use super::accessor::{Accessor, view_range};
use super::json::At;
use super::uri::{self, Uri};
use crate::alpha::{AlphaTest, Bytes, Image, Texture, Wrap};
use crate::extension_names::{
    EXT_TEXTURE_AVIF, EXT_TEXTURE_WEBP, KHR_TEXTURE_BASISU, KHR_TEXTURE_TRANSFORM, MSFT_TEXTURE_DDS,
};
use crate::{Document, Error};

/// Extensions that refer to an image in another format.
pub(super) const SOURCES: [&str; 4] = [KHR_TEXTURE_BASISU, EXT_TEXTURE_WEBP, EXT_TEXTURE_AVIF, MSFT_TEXTURE_DDS];

pub(crate) fn alpha_test(doc: &Document, material: usize) -> Result<AlphaTest, Error> {
    let root = At::root(doc);
    let list = root.need("materials")?;
    let at = list.element(material).ok_or_else(|| list.error(format_args!("there is no material {material}")))?;
    let cutoff = at.get("alphaCutoff").map_or(Ok(0.5), |cutoff| cutoff.number())?;
    let Some(color) = at.get("pbrMetallicRoughness") else {
        return Ok(AlphaTest { cutoff, factor: 1.0, texture: None });
    };
    let factor = color.get("baseColorFactor").map_or(Ok(1.0), |factor| factor.numbers::<4>().map(|rgba| rgba[3]))?;
    let texture = color.get("baseColorTexture").map(|at| texture(&root, &at)).transpose()?;
    Ok(AlphaTest { cutoff, factor, texture })
}

fn texture(root: &At<'_>, info: &At<'_>) -> Result<Texture, Error> {
    let index = info.need("index")?.index_into("textures", root.count("textures"))?;
    let textures = root.need("textures")?;
    let at = textures.element(index).ok_or_else(|| info.error("is missing"))?;
    let extended = || SOURCES.iter().find_map(|name| at.extension(name)?.get("source"));
    let source = at.get("source").or_else(extended).ok_or_else(|| at.error("has no image"))?;
    let image = source.index_into("images", root.count("images"))?;
    let wrap = match at.index("sampler", "samplers", root.count("samplers"))? {
        None => [Wrap::Repeat; 2],
        Some(sampler) => wraps(&root.need("samplers")?.element(sampler).ok_or_else(|| at.error("is missing"))?)?,
    };
    let mut texcoord = info.get("texCoord").map_or(Ok(0), |n| n.integer())?;
    let mut transform = DAffine2::IDENTITY;
    if let Some(at) = info.extension(KHR_TEXTURE_TRANSFORM) {
        texcoord = at.get("texCoord").map_or(Ok(texcoord), |n| n.integer())?;
        transform = transformed(&at)?;
    }
    Ok(Texture { image, texcoord, wrap, transform })
}

fn wraps(sampler: &At<'_>) -> Result<[Wrap; 2], Error> {
    let wrap = |key| match sampler.get(key).map_or(Ok(10497), |mode| mode.integer())? {
        10497 => Ok(Wrap::Repeat),
        33071 => Ok(Wrap::Clamp),
        33648 => Ok(Wrap::Mirror),
        other => Err(sampler.error_at(key, format_args!("there is no wrapping mode {other}"))),
    };
    Ok([wrap("wrapS")?, wrap("wrapT")?])
}

/// Returns the texture transform: scale, then rotation (counter-clockwise as seen with v pointing down), then offset.
pub(super) fn transformed(at: &At<'_>) -> Result<DAffine2, Error> {
    let pair = |key, default: f64| match at.get(key) {
        Some(pair) => pair.numbers::<2>().map(DVec2::from_array),
        None => Ok(DVec2::splat(default)),
    };
    let angle = at.get("rotation").map_or(Ok(0.0), |angle| angle.number())?;
    let matrix2 = DMat2::from_angle(-angle) * DMat2::from_diagonal(pair("scale", 1.0)?);
    Ok(DAffine2 { matrix2, translation: pair("offset", 0.0)? })
}

pub(crate) fn image(doc: &Document, index: usize) -> Image {
    let name = format!("images[{index}]");
    let root = At::root(doc);
    match root.get("images").and_then(|list| list.element(index)) {
        None => Image::broken(name, "there is no such image".into()),
        Some(at) => source(doc, &at, &name).unwrap_or_else(|e| Image::broken(name, e.to_string())),
    }
}

fn source(doc: &Document, at: &At<'_>, name: &str) -> Result<Image, Error> {
    if let Some(view) = at.get("bufferView") {
        let bytes = view_bytes(doc, &view)?;
        return Ok(Image::from_bytes(name.to_owned(), bytes));
    }
    let at = at.need("uri")?;
    let text = at.string()?;
    match uri::parse(text) {
        Uri::Data { base64, payload, .. } => {
            let bytes = uri::decode(base64, payload).map_err(|cause| at.error(cause))?;
            Ok(Image::from_bytes(name.to_owned(), bytes.into()))
        }
        Uri::File(file) => {
            let path = uri::locate(uri::folder_of(&doc.path), text, &file);
            Ok(Image::file(format!("{name} `{file}`"), path))
        }
        Uri::Scheme(scheme) => {
            Err(at.error(format_args!("URIs of the scheme {scheme}: are not supported")).unsupported())
        }
        Uri::Malformed(cause) => Err(at.error(cause)),
    }
}

pub(crate) fn texcoords(doc: &Document, mesh: usize, primitive: usize, set: usize) -> Result<Vec<[f32; 2]>, Error> {
    let root = At::root(doc);
    let meshes = root.need("meshes")?;
    let at = meshes.element(mesh).ok_or_else(|| meshes.error(format_args!("there is no mesh {mesh}")))?;
    let primitives = at.need("primitives")?;
    let at = primitives.element(primitive).ok_or_else(|| primitives.error("is too short"))?;
    let name = format!("TEXCOORD_{set}");
    let attributes = at.need("attributes")?;
    let index = attributes.entries()?.find(|(key, _)| *key == name).map(|(_, index)| index);
    let index = index.ok_or_else(|| attributes.error(format_args!("has no {name}")))?;
    let accessor = Accessor::referred(doc, &index)?;
    if accessor.kind != "VEC2" {
        return Err(index.error(format_args!("{name} must be VEC2")));
    }
    Ok(accessor.vectors_f32::<2>())
}

/// Returns the bytes of the buffer view that an index property refers to, shared with the document.
fn view_bytes(doc: &Document, index: &At<'_>) -> Result<Bytes, Error> {
    let root = At::root(doc);
    let number = index.index_into("bufferViews", root.count("bufferViews"))?;
    let views = root.need("bufferViews")?;
    let view = views.element(number).ok_or_else(|| index.error("is missing"))?;
    let (buffer, range) = view_range(doc, &view)?;
    let bytes = doc.buffers[buffer].slice(range);
    // A slice keeps the whole buffer alive for as long as the image exists.
    let is_small = bytes.len() < doc.buffers[buffer].len() / 2;
    Ok(if is_small { Bytes::copy_from_slice(&bytes) } else { bytes })
}
