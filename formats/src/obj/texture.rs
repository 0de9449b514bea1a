//! Texture statements of MTL (`map_Kd -s 1 1 1 file name.png`) and their conversion to glTF textures.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use image::DynamicImage;
use serde_json::{Value, json};

use super::files::Files;
use super::notes::Notes;
use super::picture::{self, Channel};
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
    /// `-imfchan`: the channel of a map of one number.
    pub(super) channel: Channel,
    /// `-mm`, unless it changes nothing: the base, and the gain by which the colours of the picture are multiplied.
    levels: Option<[f64; 2]>,
    /// Options that change the picture and that glTF has no notion of.
    pub(super) unsaid: Vec<&'static str>,
}

impl Statement {
    /// Parses a statement. Options may precede or follow the file name, which may contain spaces.
    pub(super) fn parse(text: &str) -> Self {
        let mut out = Statement {
            file: String::new(),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            strength: 1.0,
            channel: Channel::Usual,
            levels: None,
            unsaid: Vec::new(),
        };
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
            "-clamp" => self.clamp = arguments.first().is_some_and(|word| word.eq_ignore_ascii_case("on")),
            "-imfchan" => self.channel = channel(arguments.first().copied().unwrap_or_default()),
            "-mm" => self.levels = number(0).zip(number(1)).map(Into::into).filter(|levels| *levels != [0.0, 1.0]),
            "-t" if (0..3).any(|i| number(i).is_some_and(|x| x != 0.0)) => self.unsaid.push("-t"),
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

/// Returns the channel of a word of `-imfchan`.
fn channel(word: &str) -> Channel {
    match word.to_ascii_lowercase().as_str() {
        "r" => Channel::Red,
        "g" => Channel::Green,
        "b" => Channel::Blue,
        "m" => Channel::Alpha,
        "l" => Channel::Luminance,
        _ => Channel::Usual,
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
    /// Images that are no files; `bufferView` of [`Textures::images`] is an index into this list.
    pub(super) embedded: Vec<Vec<u8>>,
    /// Images made of others, by what they are made of; `None` if that failed.
    made: HashMap<String, Option<usize>>,
}

impl Textures {
    /// Returns the glTF `textureInfo` of a statement in an MTL file of folder `base`; `None` with a warning if the file
    /// is missing or no image. Images that are neither PNG nor JPEG, which glTF does not allow, are converted to PNG.
    pub(super) fn info(
        &mut self,
        statement: &Statement,
        base: &Path,
        files: &mut Files,
        notes: &mut Notes,
    ) -> Option<Value> {
        let found = find(base, &statement.file, files, notes)?;
        let source = match allowed(&found).filter(|_| statement.levels.is_none()) {
            Some(mime) if found.to_str().is_none() => {
                // A URI cannot name this file.
                let bytes = || std::fs::read(&found).map_err(|e| e.to_string());
                self.embed(&found.to_string_lossy(), &found, bytes, mime)
            }
            Some(_) => Ok(self.images.number(json!({"uri": files.uri(&found)}))),
            None => {
                self.embed(&statement.key(&found), &found, || picture::png(&statement.picture(&found)?), "image/png")
            }
        };
        match source {
            Ok(source) => Some(self.place(source, statement)),
            Err(cause) => {
                let message = "cannot be converted to PNG";
                let file = &statement.file;
                notes.add(String::new, &format!("texture `{file}` {message}, kept by name in extras only: {cause}"));
                None
            }
        }
    }

    /// Returns the `textureInfo` of an image that is made of others; the statement places it. `key` tells what it is made
    /// of, and `name` is the file that it is named after.
    ///
    /// # Errors
    /// Says why it cannot be made.
    pub(super) fn made(
        &mut self,
        key: &str,
        name: &Path,
        statement: &Statement,
        make: impl FnOnce() -> Result<DynamicImage, String>,
    ) -> Result<Value, String> {
        let source = self.embed(key, name, || picture::png(&make()?), "image/png")?;
        Ok(self.place(source, statement))
    }

    /// Returns the index of an image with these bytes; `key` tells images apart.
    fn embed(
        &mut self,
        key: &str,
        name: &Path,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
        mime: &str,
    ) -> Result<usize, String> {
        if let Some(&known) = self.made.get(key) {
            return known.ok_or_else(|| "see the first warning".to_owned());
        }
        let bytes = bytes();
        let index = bytes.map(|bytes| {
            self.embedded.push(bytes);
            let name = name.file_stem().unwrap_or_default().to_string_lossy();
            self.images.number(json!({"name": name, "mimeType": mime, "bufferView": self.embedded.len() - 1}))
        });
        self.made.insert(key.to_owned(), index.as_ref().ok().copied());
        index
    }

    /// Returns the `textureInfo` of an image, placed by a statement.
    fn place(&mut self, source: usize, statement: &Statement) -> Value {
        let mut texture = json!({"source": source});
        if statement.clamp {
            // 33071 is CLAMP_TO_EDGE.
            texture["sampler"] = self.samplers.number(json!({"wrapS": 33071, "wrapT": 33071})).into();
        }
        let mut info = json!({"index": self.textures.number(texture)});
        if let Some(transform) = statement.transform() {
            self.transformed = true;
            info["extensions"] = json!({KHR_TEXTURE_TRANSFORM: transform});
        }
        info
    }
}

impl Statement {
    /// Reads the picture from a file, with its levels.
    ///
    /// # Errors
    /// Says why it cannot be read.
    pub(super) fn picture(&self, file: &Path) -> Result<DynamicImage, String> {
        let image = picture::read(file)?;
        Ok(self.levels.map(|levels| picture::with_levels(&image, levels)).unwrap_or(image))
    }

    /// Tells apart what is read from a file.
    pub(super) fn key(&self, file: &Path) -> String {
        format!("{} {:?} {:?}", file.display(), self.channel, self.levels)
    }

    /// Whether a map of one number is the alpha of its picture, as far as the options say.
    pub(super) fn is_alpha(&self) -> bool {
        matches!(self.channel, Channel::Usual | Channel::Alpha) && self.levels.is_none()
    }

    /// Whether a map of one number may be read from that channel of its picture.
    pub(super) fn may_be_read_from(&self, channel: Channel) -> bool {
        self.channel == Channel::Usual || self.channel == channel
    }

    /// Whether two textures lie alike on a surface.
    pub(super) fn lies_as(&self, other: &Statement) -> bool {
        (self.scale, self.offset, self.clamp) == (other.scale, other.offset, other.clamp)
    }
}

/// Finds the image of a statement in an MTL file of folder `base`; a missing one causes a warning.
pub(super) fn find(base: &Path, written: &str, files: &mut Files, notes: &mut Notes) -> Option<PathBuf> {
    let found = files.find(base, written);
    match &found {
        Some(file) if files.is_outside(file) => {
            notes.add(String::new, &format!("texture `{written}` read from outside the folder of the model"));
        }
        Some(_) => {}
        None if written.to_ascii_uppercase().contains("<UDIM>") => {
            let message = "is a set of UDIM tiles, of which glTF has no notion: kept by name in extras only";
            notes.add(String::new, &format!("texture `{written}` {message}"));
        }
        None => notes.add(String::new, &format!("texture `{written}` not found: kept by name in extras only")),
    }
    found
}

/// Returns the media type of an image that glTF allows, by its first bytes.
fn allowed(file: &Path) -> Option<&'static str> {
    use std::io::Read;
    let mut magic = [0; 4];
    std::fs::File::open(file).and_then(|mut file| file.read_exact(&mut magic)).ok()?;
    match magic {
        [0x89, b'P', b'N', b'G'] => Some("image/png"),
        [0xFF, 0xD8, 0xFF, _] => Some("image/jpeg"),
        _ => None,
    }
}
