//! Reads animations by what they move.

use super::super::json::{At, unsigned};
use super::follow::Numbers;
use super::{extras, follow};
use crate::Document;
use crate::extension_names::KHR_ANIMATION_POINTER;
use crate::properties::{Animation, Channel, Property};

pub(crate) fn animations(doc: &Document) -> Vec<Animation> {
    let mut numbers = Numbers::of(doc);
    At::root(doc).list("animations").into_iter().flatten().map(|at| animation(doc, &at, &mut numbers)).collect()
}

fn animation(doc: &Document, at: &At<'_>, numbers: &mut Numbers<'_>) -> Animation {
    let channels = at.list("channels").into_iter().flatten();
    let mut more = follow::extensions(doc, at);
    more.extend(extras(at).map(|extras| ("extras".to_owned(), extras)));
    Animation { name: at.name(), channels: channels.filter_map(|channel| read(at, &channel, numbers)).collect(), more }
}

fn read(animation: &At<'_>, channel: &At<'_>, all: &mut Numbers<'_>) -> Option<Channel> {
    let sampler = animation.get("samplers")?.element(unsigned(channel.get("sampler")?.value)?)?;
    let (target, path) = target(&channel.get("target")?)?;
    let mut numbers = |key| sampler.get(key).map(|accessor| all.get(accessor.value)).unwrap_or_default();
    let interpolation = sampler.get("interpolation").and_then(|i| i.value.as_str()).unwrap_or("LINEAR").to_owned();
    Some(Channel { target, path, interpolation, times: numbers("input"), values: numbers("output") })
}

fn target(at: &At<'_>) -> Option<(Property, String)> {
    let Some(pointer) = at.extension(KHR_ANIMATION_POINTER).and_then(|e| e.get("pointer")) else {
        let path = at.get("path")?.value.as_str()?.to_owned();
        return Some((Property::Node(unsigned(at.get("node")?.value)?), path));
    };
    let text = pointer.value.as_str()?;
    let mut parts = text.splitn(4, '/').skip(1);
    let (list, index) = (parts.next()?, parts.next().and_then(|index| index.parse().ok()));
    let rest = parts.next().unwrap_or_default().to_owned();
    Some(match (list, index) {
        ("nodes", Some(node)) => (Property::Node(node), rest),
        ("materials", Some(material)) => (Property::Material(Some(material)), rest),
        _ => (Property::Text(text.to_owned()), String::new()),
    })
}
