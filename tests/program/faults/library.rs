//! Faults in what a file means beyond the places of its triangles. Each changes a document at random and says what it
//! changed, or does nothing if the document has nothing of the kind.

use raykiln::verify::contents::DifferenceKind as Kind;
use serde_json::{Value, json};

use super::planting::{
    Fault, change_float, drop_attribute, element_with, fault, has, has_variants, input_node, key, morph,
    number_in_material, pick, primitive_with, primitive_with_mode, push_view, shown_material, texture, vertex,
};

/// Faults in contents.
pub(super) const FAULTS: &[Fault] = &[
    fault("base color changed", &[Kind::MaterialFactor], |doc, rng| {
        number_in_material(doc, rng, "/pbrMetallicRoughness/baseColorFactor/1", &[])
    }),
    fault("metallic factor changed", &[Kind::MaterialFactor], |doc, rng| {
        number_in_material(doc, rng, "/pbrMetallicRoughness/metallicFactor", &[])
    }),
    fault("roughness factor added", &[Kind::MaterialFactor], |doc, rng| {
        let material = shown_material(doc, rng, |material| material["pbrMetallicRoughness"].is_object())?;
        doc.json["materials"][material]["pbrMetallicRoughness"]["roughnessFactor"] =
            rng.f64().mul_add(0.4, 0.51).into();
        Some(format!("materials[{material}]"))
    }),
    fault("emission changed", &[Kind::MaterialFactor], |doc, rng| {
        number_in_material(doc, rng, "/emissiveFactor/0", &[])
    }),
    fault("alpha mode changed", &[Kind::AlphaMode], |doc, rng| {
        let material = shown_material(doc, rng, |_| true)?;
        let modes = ["BLEND", "MASK", "OPAQUE"];
        let now = doc.json["materials"][material]["alphaMode"].as_str().unwrap_or("OPAQUE").to_owned();
        let other = pick(rng, modes.into_iter().filter(|mode| *mode != now))?;
        doc.json["materials"][material]["alphaMode"] = other.into();
        Some(format!("materials[{material}]: {now} to {other}"))
    }),
    fault("alpha cutoff changed", &[Kind::AlphaMode], |doc, rng| number_in_material(doc, rng, "/alphaCutoff", &[])),
    fault("sides changed", &[Kind::DoubleSided], |doc, rng| {
        let material = shown_material(doc, rng, |_| true)?;
        let sides = doc.json["materials"][material]["doubleSided"] != true;
        doc.json["materials"][material]["doubleSided"] = sides.into();
        Some(format!("materials[{material}]"))
    }),
    fault("extension of a material changed", &[Kind::MaterialExtension], |doc, rng| {
        number_in_material(
            doc,
            rng,
            "/extensions/KHR_materials_clearcoat/clearcoatFactor",
            &["/extensions/KHR_materials_ior/ior"],
        )
    }),
    fault("extension of a material dropped", &[Kind::MaterialExtension], |doc, rng| {
        let material = shown_material(doc, rng, |material| material["extensions"].is_object())?;
        let extensions = doc.json["materials"][material]["extensions"].as_object_mut()?;
        let name = pick(rng, extensions.keys().cloned().collect::<Vec<_>>())?;
        extensions.remove(&name);
        Some(name)
    }),
    fault("extras of a material changed", &[Kind::MaterialExtras], |doc, rng| {
        let material = shown_material(doc, rng, |_| true)?;
        doc.json["materials"][material]["extras"] = json!({"planted": rng.u32(..)});
        Some(format!("materials[{material}]"))
    }),
    fault("materials exchanged", MATERIAL, |doc, rng| {
        let count = doc.json["materials"].as_array()?.len();
        let first = shown_material(doc, rng, |_| true)?;
        let second = pick(rng, (0..count).filter(|i| *i != first))?;
        doc.json["materials"].as_array_mut()?.swap(first, second);
        Some(format!("materials[{first}] and materials[{second}]"))
    }),
    fault("material dropped", MATERIAL, |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["material"].is_u64())?;
        doc.json["meshes"][mesh]["primitives"][primitive].as_object_mut()?.remove("material");
        Some(format!("meshes[{mesh}].primitives[{primitive}]"))
    }),
    fault("texture dropped", &[Kind::TextureMissing], |doc, rng| {
        let (material, place) = texture(doc, rng)?;
        let (owner, key) = place.rsplit_once('/')?;
        doc.json["materials"][material].pointer_mut(owner)?.as_object_mut()?.remove(key);
        Some(format!("materials[{material}]{place}"))
    }),
    fault("texture exchanged", &[Kind::TextureImage, Kind::TextureSampler], |doc, rng| {
        let (material, place) = texture(doc, rng)?;
        let count = doc.json["textures"].as_array()?.len();
        let index = &mut doc.json["materials"][material].pointer_mut(place)?["index"];
        *index = pick(rng, (0..count).filter(|i| *index != json!(i)))?.into();
        Some(format!("materials[{material}]{place}"))
    }),
    fault("pixel changed", &[Kind::TextureImage], |doc, rng| {
        let image = pick(rng, 0..doc.json.get("images")?.as_array()?.len())?;
        let pixels: Vec<u8> = (0..4).map(|_| rng.u8(..)).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.write_header().ok()?.write_image_data(&pixels).ok()?;
        let view = push_view(doc, &bytes);
        doc.json["images"][image] = json!({"bufferView": view, "mimeType": "image/png"});
        Some(format!("images[{image}]"))
    }),
    fault("wrapping of a texture changed", &[Kind::TextureSampler], |doc, rng| {
        let sampler = pick(rng, 0..doc.json.get("samplers")?.as_array()?.len())?;
        doc.json["samplers"][sampler][["wrapS", "wrapT"][rng.usize(..2)]] = 33648.into();
        Some(format!("samplers[{sampler}]"))
    }),
    fault("filter of a texture changed", &[Kind::TextureSampler], |doc, rng| {
        let sampler = pick(rng, 0..doc.json.get("samplers")?.as_array()?.len())?;
        doc.json["samplers"][sampler]["magFilter"] = 9728.into();
        Some(format!("samplers[{sampler}]"))
    }),
    fault("strength of a texture changed", &[Kind::MaterialFactor], |doc, rng| {
        number_in_material(doc, rng, "/normalTexture/scale", &["/occlusionTexture/strength"])
    }),
    fault("transform of a texture changed", &[Kind::TextureTransform], |doc, rng| {
        let (material, place) = texture(doc, rng)?;
        let info = doc.json["materials"][material].pointer_mut(place)?;
        info["extensions"]["KHR_texture_transform"] = json!({"offset": [rng.f64() + 0.01, 0.0]});
        Some(format!("materials[{material}]{place}"))
    }),
    fault("set of texture coordinates changed", &[Kind::TextureTransform, Kind::AttributeMissing], |doc, rng| {
        let (material, place) = texture(doc, rng)?;
        let set = &mut doc.json["materials"][material].pointer_mut(place)?["texCoord"];
        *set = json!(1 - set.as_u64().unwrap_or(0).min(1));
        Some(format!("materials[{material}]{place}"))
    }),
    fault("normal turned", &[Kind::Normal], |doc, rng| vertex(doc, rng, "NORMAL", |x| [x[1] + 0.5, x[2], x[0], 0.0])),
    fault("tangent turned", &[Kind::Tangent], |doc, rng| {
        vertex(doc, rng, "TANGENT", |x| [x[1], x[2] + 0.5, x[0], x[3]])
    }),
    fault("tangent of the other hand", &[Kind::Tangent], |doc, rng| {
        vertex(doc, rng, "TANGENT", |x| [x[0], x[1], x[2], -x[3]])
    }),
    fault("texture coordinate moved", &[Kind::TextureCoordinates], |doc, rng| {
        vertex(doc, rng, "TEXCOORD_0", |x| [x[0] + 0.01, x[1], 0.0, 0.0])
    }),
    fault("second texture coordinate moved", &[Kind::TextureCoordinates], |doc, rng| {
        vertex(doc, rng, "TEXCOORD_1", |x| [x[0], x[1] - 0.01, 0.0, 0.0])
    }),
    fault("color changed", &[Kind::Color], |doc, rng| vertex(doc, rng, "COLOR_0", |x| [x[0], x[1], x[2] - 0.1, x[3]])),
    fault("custom attribute changed", &[Kind::CustomAttribute], |doc, rng| {
        vertex(doc, rng, "_HEAT", |x| [x[0] + 1e-3, 0.0, 0.0, 0.0])
    }),
    fault("weight of a joint changed", &[Kind::SkinWeights], |doc, rng| {
        vertex(doc, rng, "WEIGHTS_0", |x| [x[0] - 0.1, x[1] + 0.1, x[2], x[3]])
    }),
    fault("joints exchanged", &[Kind::SkinWeights], |doc, rng| {
        vertex(doc, rng, "JOINTS_0", |x| [x[1], x[0], x[2], x[3]])
    }),
    fault("normals dropped", &[Kind::AttributeMissing], |doc, rng| drop_attribute(doc, rng, "NORMAL")),
    fault("tangents dropped", &[Kind::AttributeMissing], |doc, rng| drop_attribute(doc, rng, "TANGENT")),
    fault("texture coordinates dropped", &[Kind::AttributeMissing], |doc, rng| drop_attribute(doc, rng, "TEXCOORD_0")),
    fault("colors dropped", &[Kind::Color], |doc, rng| drop_attribute(doc, rng, "COLOR_0")),
    fault("custom attribute dropped", &[Kind::AttributeMissing], |doc, rng| drop_attribute(doc, rng, "_HEAT")),
    fault("morph target moved", &[Kind::MorphTarget], |doc, rng| morph(doc, rng, "POSITION")),
    fault("normal of a morph target turned", &[Kind::MorphTarget], |doc, rng| morph(doc, rng, "NORMAL")),
    fault("morph target dropped", &[Kind::MorphTarget], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["targets"].is_array())?;
        doc.json["meshes"][mesh]["primitives"][primitive].as_object_mut()?.remove("targets");
        Some(format!("meshes[{mesh}]"))
    }),
    fault("morph weight changed", &[Kind::MorphWeights], |doc, rng| {
        let mesh = element_with(doc, rng, "meshes", |mesh| mesh["weights"].is_array())?;
        doc.json["meshes"][mesh]["weights"][0] = rng.f64().mul_add(0.4, 0.51).into();
        Some(format!("meshes[{mesh}]"))
    }),
    fault("variant changed", &[Kind::Variant], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, has_variants)?;
        let path = "/extensions/KHR_materials_variants/mappings/0/material";
        *doc.json["meshes"][mesh]["primitives"][primitive].pointer_mut(path)? = rng.usize(..2).into();
        Some(format!("meshes[{mesh}]"))
    }),
    fault("variants dropped", &[Kind::Variant], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, has_variants)?;
        doc.json["meshes"][mesh]["primitives"][primitive].as_object_mut()?.remove("extensions");
        Some(format!("meshes[{mesh}]"))
    }),
    fault("extras of a primitive changed", &[Kind::PrimitiveExtras], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["extras"]["part"].is_string())?;
        doc.json["meshes"][mesh]["primitives"][primitive]["extras"]["part"] = rng.u32(..).into();
        Some(format!("meshes[{mesh}]"))
    }),
    fault("extras of a mesh changed", &[Kind::MeshExtras], |doc, rng| {
        let holders = ["/extras/kind", "/extras/raykiln/mesh/extras/kind"];
        // A mesh that no node places says nothing.
        let is_placed =
            |mesh: usize| doc.json["nodes"].as_array().is_some_and(|n| n.iter().any(|n| n["mesh"] == json!(mesh)));
        let lists = ["meshes", "nodes"];
        let places = lists.into_iter().zip(holders).flat_map(|(list, path)| {
            let all = doc.json[list].as_array().into_iter().flatten().enumerate();
            all.filter(|(i, at)| at.pointer(path).is_some() && (list == "nodes" || is_placed(*i)))
                .map(move |(i, _)| (list, i, path))
                .collect::<Vec<_>>()
        });
        let (list, i, path) = pick(rng, places.collect::<Vec<_>>())?;
        *doc.json[list][i].pointer_mut(path)? = rng.u32(..).into();
        Some(format!("{list}[{i}]"))
    }),
    fault("node renamed", &[Kind::NodeRenamed], |doc, rng| {
        let node = input_node(doc, rng, |_| true)?;
        doc.json["nodes"][node]["name"] = format!("planted {}", rng.u32(..)).into();
        Some(format!("nodes[{node}]"))
    }),
    fault("name of a node dropped", &[Kind::NodeRenamed], |doc, rng| {
        let node = input_node(doc, rng, |_| true)?;
        doc.json["nodes"][node].as_object_mut()?.remove("name");
        Some(format!("nodes[{node}]"))
    }),
    fault("node moved", &[Kind::NodeMoved], |doc, rng| {
        let node = input_node(doc, rng, |node| node.get("mesh").is_none() && node["translation"].is_array())?;
        let axis = rng.usize(..3);
        let place = &mut doc.json["nodes"][node]["translation"][axis];
        *place = json!(place.as_f64()? + 0.01 + rng.f64());
        Some(format!("nodes[{node}]"))
    }),
    fault("node hung elsewhere", &[Kind::NodeReparented], |doc, rng| {
        let node = input_node(doc, rng, |node| node.get("mesh").is_none() && node.get("children").is_none())?;
        let parents = doc.json["nodes"].as_array()?.iter().position(|n| has(&n["children"], node))?;
        let others =
            |other: &usize| ![node, parents].contains(other) && doc.json["nodes"][*other]["children"].is_array();
        let other = pick(rng, (0..doc.json["nodes"].as_array()?.len()).filter(others).collect::<Vec<_>>())?;
        doc.json["nodes"][parents]["children"].as_array_mut()?.retain(|child| *child != json!(node));
        doc.json["nodes"][other]["children"].as_array_mut()?.push(node.into());
        if doc.json["nodes"][parents]["children"] == json!([]) {
            doc.json["nodes"][parents].as_object_mut()?.remove("children");
        }
        Some(format!("nodes[{node}] below nodes[{other}]"))
    }),
    fault("extras of a node changed", &[Kind::NodeExtras], |doc, rng| {
        let node = input_node(doc, rng, |_| true)?;
        doc.json["nodes"][node]["extras"]["planted"] = rng.u32(..).into();
        Some(format!("nodes[{node}]"))
    }),
    fault("extras of a node dropped", &[Kind::NodeExtras], |doc, rng| {
        let node = input_node(doc, rng, |n| n["extras"].as_object().is_some_and(|e| e.keys().any(|k| k != "raykiln")))?;
        doc.json["nodes"][node]["extras"].as_object_mut()?.retain(|key, _| key == "raykiln");
        Some(format!("nodes[{node}]"))
    }),
    fault("extension of a node changed", &[Kind::NodeExtension], |doc, rng| {
        let node = element_with(doc, rng, "nodes", |node| node.pointer("/extensions/ACME_spin").is_some())?;
        doc.json["nodes"][node]["extensions"]["ACME_spin"]["speed"] = rng.f64().into();
        Some(format!("nodes[{node}]"))
    }),
    fault("extension of the file changed", &[Kind::FileData], |doc, rng| {
        *doc.json.pointer_mut("/extensions/ACME_spin/unit")? = rng.u32(..).into();
        Some("ACME_spin".into())
    }),
    fault("camera changed", &[Kind::Camera], |doc, rng| {
        *doc.json.pointer_mut("/cameras/0/perspective/yfov")? = rng.f64().mul_add(0.3, 0.2).into();
        Some("cameras[0]".into())
    }),
    fault("camera dropped", &[Kind::Camera], |doc, rng| {
        let node = element_with(doc, rng, "nodes", |node| node["camera"].is_u64())?;
        doc.json["nodes"][node].as_object_mut()?.remove("camera");
        Some(format!("nodes[{node}]"))
    }),
    fault("light changed", &[Kind::Light], |doc, rng| {
        *doc.json.pointer_mut("/extensions/KHR_lights_punctual/lights/0/intensity")? = rng.u32(50..90).into();
        Some("lights[0]".into())
    }),
    fault("light dropped", &[Kind::Light], |doc, rng| {
        let node = element_with(doc, rng, "nodes", |node| node["extensions"]["KHR_lights_punctual"].is_object())?;
        doc.json["nodes"][node]["extensions"].as_object_mut()?.remove("KHR_lights_punctual");
        Some(format!("nodes[{node}]"))
    }),
    fault("light added", &[Kind::LightAdded], |doc, rng| {
        doc.json.pointer("/extensions/KHR_lights_punctual/lights/0")?;
        let node = input_node(doc, rng, |node| node.get("extensions").is_none() && node.get("mesh").is_none())?;
        doc.json["nodes"][node]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        Some(format!("nodes[{node}]"))
    }),
    fault("animation dropped", &[Kind::AnimationMissing], |doc, _| {
        doc.json.as_object_mut()?.remove("animations").map(|_| "animations".to_owned())
    }),
    fault("key of an animation changed", &[Kind::AnimationKeys], |doc, rng| key(doc, rng, "output")),
    fault("time of a key changed", &[Kind::AnimationKeys], |doc, rng| key(doc, rng, "input")),
    fault("interpolation changed", &[Kind::AnimationKeys], |doc, rng| {
        let count = doc.json.pointer("/animations/0/samplers")?.as_array()?.len();
        let sampler = &mut doc.json["animations"][0]["samplers"][rng.usize(..count)];
        sampler["interpolation"] = if sampler["interpolation"] == "STEP" { "LINEAR" } else { "STEP" }.into();
        Some("an interpolation".into())
    }),
    fault("target of an animation changed", &[Kind::ChannelMissing], |doc, rng| {
        let count = doc.json.pointer("/animations/0/channels")?.as_array()?.len();
        let other = input_node(doc, rng, |_| true)?;
        let target = &mut doc.json["animations"][0]["channels"][rng.usize(..count)]["target"]["node"];
        let changes = *target != json!(other);
        *target = other.into();
        changes.then(|| format!("nodes[{other}]"))
    }),
    fault("channel dropped", &[Kind::ChannelMissing], |doc, rng| {
        let channels = doc.json.pointer_mut("/animations/0/channels")?.as_array_mut()?;
        let channel = rng.usize(..channels.len());
        (channels.len() > 1).then(|| channels.remove(channel).to_string())
    }),
    fault("joint dropped", &[Kind::Skin, Kind::SkinWeights], |doc, _| {
        doc.json.pointer_mut("/skins/0/joints")?.as_array_mut()?.pop().map(|joint| joint.to_string())
    }),
    fault("bind matrix changed", &[Kind::Skin], |doc, rng| {
        let accessor = doc.json.pointer("/skins/0/inverseBindMatrices")?.as_u64()? as usize;
        change_float(doc, accessor, rng.usize(..2) * 16 + 12 + rng.usize(..3), |x| x + 0.1)
    }),
    fault("skin dropped", &[Kind::Skin], |doc, rng| {
        let node = element_with(doc, rng, "nodes", |node| node["skin"].is_u64())?;
        doc.json["nodes"][node].as_object_mut()?.remove("skin");
        Some(format!("nodes[{node}]"))
    }),
    fault("node of a scene dropped", &[Kind::SceneNodes], |doc, rng| {
        let scene = element_with(doc, rng, "scenes", |scene| scene["nodes"].as_array().is_some_and(|n| n.len() > 1))?;
        let default = doc.json["scene"].as_u64() == Some(scene as u64);
        let nodes = doc.json["scenes"][scene]["nodes"].as_array()?.clone();
        let all = &doc.json["nodes"];
        // Triangles are another matter.
        let is_empty = |node: &Value| {
            let node = &all[node.as_u64().unwrap_or(0) as usize];
            node.get("mesh").is_none() && node.get("children").is_none()
        };
        let node = pick(rng, nodes.into_iter().filter(|node| !default || is_empty(node)))?;
        let roots = doc.json["scenes"][scene]["nodes"].as_array_mut()?;
        roots.retain(|root| *root != node);
        Some(format!("nodes[{node}] of scenes[{scene}]"))
    }),
    fault("scene dropped", &[Kind::SceneMissing], |doc, _| {
        let scenes = doc.json.get_mut("scenes")?.as_array_mut()?;
        (scenes.len() > 1).then(|| drop(scenes.pop())).map(|()| "the last".to_owned())
    }),
    fault("scene renamed", &[Kind::SceneName], |doc, rng| {
        let scene = element_with(doc, rng, "scenes", |scene| scene["name"].is_string())?;
        doc.json["scenes"][scene]["name"] = format!("planted {}", rng.u32(..)).into();
        Some(format!("scenes[{scene}]"))
    }),
    fault("extras of a scene changed", &[Kind::SceneData], |doc, rng| {
        let scene = element_with(doc, rng, "scenes", |_| true)?;
        doc.json["scenes"][scene]["extras"]["planted"] = rng.u32(..).into();
        Some(format!("scenes[{scene}]"))
    }),
    fault("copyright changed", &[Kind::FileData], |doc, rng| {
        doc.json["asset"]["copyright"] = rng.u32(..).to_string().into();
        Some("copyright".into())
    }),
    fault("extras of the file changed", &[Kind::FileData], |doc, rng| {
        doc.json["extras"]["planted"] = rng.u32(..).into();
        Some("extras".into())
    }),
    fault("point moved", &[Kind::StrokeMissing], |doc, rng| {
        let (mesh, primitive) = primitive_with_mode(doc, rng, |mode| mode < 4)?;
        let position = &doc.json["meshes"][mesh]["primitives"][primitive]["attributes"]["POSITION"];
        change_float(doc, position.as_u64()? as usize, rng.usize(..12), |x| x + 0.01)
    }),
    fault("lines dropped", &[Kind::StrokeMissing], |doc, rng| {
        let (mesh, primitive) = primitive_with_mode(doc, rng, |mode| mode < 4)?;
        doc.json["meshes"][mesh]["primitives"].as_array_mut()?.remove(primitive);
        Some(format!("meshes[{mesh}]"))
    }),
    fault("material of points or lines changed", &[Kind::StrokeMaterial], |doc, rng| {
        let (mesh, primitive) = primitive_with_mode(doc, rng, |mode| mode < 4)?;
        doc.json["meshes"][mesh]["primitives"][primitive]["material"] = rng.usize(..2).into();
        Some(format!("meshes[{mesh}]"))
    }),
];

/// What an exchanged material may differ in.
const MATERIAL: &[Kind] =
    &[Kind::MaterialFactor, Kind::AlphaMode, Kind::DoubleSided, Kind::MaterialExtension, Kind::TextureMissing];
