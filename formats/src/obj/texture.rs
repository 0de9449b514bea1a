//! Texture statements of MTL (`map_Kd -s 1 1 1 file name.png`) and their conversion to glTF textures.

use std::collections::HashMap;
use std::path::Path;

use serde_json::{Value, json};

use super::files::Files;
use super::notes::Notes;
use crate::extension_names::KHR_TEXTURE_TRANSFORM;

/// A parsed texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Statement {
    /// The file, as written.
    pub(super) file: String,
    /// `-s`: scale of the texture coordinate.
    scale: [f64; 2],
    /// `-o`: offset of the texture coordinate.
    offset: [f64; 2],
    /// `-clamp on`.
    clamp: bool,
    /// `-bm`: strength of a bump or normal map.
    pub(super) strength: f64,
}

impl Statement {
    /// Parses a statement. Options may precede or follow the file name, which may contain spaces.
    pub(super) fn parse(text: &str) -> Self {
        let mut out = Statement { file: String::new(), scale: [1.0; 2], offset: [0.0; 2], clamp: false, strength: 1.0 };
        let mut rest = out.options(text);
        while let Some(start) = option_inside(rest) {
            let (before, options) = rest.split_at(start);
            let behind = out.options(options);
            if out.file.is_empty() {
                out.file = before.trim().to_owned();
            }
            rest = behind;
        }
        if out.file.is_empty() {
            out.file = rest.trim().to_owned();
        }
        out
    }

    /// Reads the options at the start of `text`; returns the text after them.
    fn options<'t>(&mut self, text: &'t str) -> &'t str {
        let mut rest = text.trim_start();
        while let Some((name, kind, behind)) = option(rest) {
            let (arguments, behind) = arguments(kind, behind);
            self.set(name, &arguments);
            rest = behind;
        }
        rest
    }

    fn set(&mut self, name: &str, arguments: &[&str]) {
        let number = |i: usize| arguments.get(i).and_then(|word| word.parse::<f64>().ok()).filter(|x| x.is_finite());
        match name {
            "-s" => self.scale = [0, 1].map(|i| number(i).unwrap_or(1.0)),
            "-o" => self.offset = [0, 1].map(|i| number(i).unwrap_or(0.0)),
            "-bm" => self.strength = number(0).unwrap_or(1.0),
            "-clamp" => self.clamp = arguments.first() == Some(&"on"),
            _ => {}
        }
    }

    /// Returns `KHR_texture_transform`. In OBJ, `t = s v + o` from the bottom; in glTF from the top, where `v' = 1 - v`
    /// and so `t' = 1 - t = s v' + (1 - s - o)`.
    fn transform(&self) -> Option<Value> {
        let ([su, sv], [ou, ov]) = (self.scale, self.offset);
        let identity = self.scale == [1.0; 2] && self.offset == [0.0; 2];
        (!identity).then(|| json!({"offset": [ou, 1.0 - sv - ov], "scale": [su, sv]}))
    }
}

/// Arguments of an option.
#[derive(Clone, Copy)]
enum Arguments {
    /// A fixed number of words.
    Words(usize),
    /// One to three numbers.
    Numbers,
}

/// Returns the option at the start of `text`, its arguments, and the text after its name.
fn option(text: &str) -> Option<(&str, Arguments, &str)> {
    let (name, rest) = text.split_once(char::is_whitespace)?;
    let kind = match name {
        "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-bm" | "-texres" | "-type" | "-boost"
        | "-colorspace" => Arguments::Words(1),
        "-mm" => Arguments::Words(2),
        "-o" | "-s" | "-t" => Arguments::Numbers,
        _ => return None,
    };
    Some((name, kind, rest.trim_start()))
}

fn arguments(kind: Arguments, text: &str) -> (Vec<&str>, &str) {
    let limit = if let Arguments::Words(count) = kind { count } else { 3 };
    let (mut out, mut rest) = (Vec::new(), text);
    while out.len() < limit && !rest.is_empty() {
        let (word, behind) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        if matches!(kind, Arguments::Numbers) && word.parse::<f64>().is_err() {
            break;
        }
        out.push(word);
        rest = behind.trim_start();
    }
    (out, rest)
}

/// Returns the position within `text` at which an option begins.
fn option_inside(text: &str) -> Option<usize> {
    text.match_indices(" -").map(|(at, _)| at + 1).find(|&at| option(&text[at..]).is_some())
}

/// Distinct JSON values, numbered in order of first appearance.
#[derive(Debug, Default)]
pub(super) struct Once {
    /// The values.
    pub(super) values: Vec<Value>,
    index: HashMap<String, usize>,
}

impl Once {
    fn number(&mut self, value: Value) -> usize {
        *self.index.entry(value.to_string()).or_insert_with(|| {
            self.values.push(value);
            self.values.len() - 1
        })
    }
}

/// The glTF textures of a document: each image, sampler and texture once.
#[derive(Debug, Default)]
pub(super) struct Textures {
    pub(super) images: Once,
    pub(super) samplers: Once,
    pub(super) textures: Once,
    /// Whether a texture info uses `KHR_texture_transform`.
    pub(super) transformed: bool,
}

impl Textures {
    /// Returns the glTF `textureInfo` of a statement in an MTL file of folder `base`; `None` with a warning if the file
    /// is neither PNG nor JPEG, which glTF does not allow. A missing file causes a warning and is still referred to.
    pub(super) fn info(
        &mut self,
        file: &Statement,
        base: &Path,
        files: &mut Files,
        notes: &mut Notes,
    ) -> Option<Value> {
        let found = files.find(base, &file.file);
        let image = match &found {
            Some(path) => files.uri(path),
            None => files.uri_as_written(base, &file.file),
        };
        if image.is_empty() || !allowed(found.as_deref(), &image) {
            let message = format!("texture `{}` is neither PNG nor JPEG: kept by name in extras only", file.file);
            notes.add(String::new, &message);
            return None;
        }
        if found.is_none() {
            notes.add(String::new, &format!("texture `{}` not found", file.file));
        }
        let source = self.images.number(json!({"uri": image}));
        let mut texture = json!({"source": source});
        if file.clamp {
            // 33071 is CLAMP_TO_EDGE.
            texture["sampler"] = self.samplers.number(json!({"wrapS": 33071, "wrapT": 33071})).into();
        }
        let mut info = json!({"index": self.textures.number(texture)});
        if let Some(transform) = file.transform() {
            self.transformed = true;
            info["extensions"] = json!({KHR_TEXTURE_TRANSFORM: transform});
        }
        Some(info)
    }
}

/// Whether glTF allows the image: by its first bytes if the file exists, otherwise by its extension.
fn allowed(found: Option<&Path>, name: &str) -> bool {
    let mut magic = [0; 4];
    let read = |path: &Path| {
        use std::io::Read;
        std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
    };
    match found.map(read) {
        Some(true) => magic == *b"\x89PNG" || magic.starts_with(&[0xFF, 0xD8, 0xFF]),
        _ => {
            let name = name.to_ascii_lowercase();
            [".png", ".jpg", ".jpeg"].iter().any(|end| name.ends_with(end))
        }
    }
}
