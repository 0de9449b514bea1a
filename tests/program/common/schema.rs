//! Validates reports against their JSON Schemas in `docs/schemas`. Only the keywords used there are known; others
//! panic.

use serde_json::Value;
use std::fs;
use std::path::Path;

/// Panics unless a report conforms to its schema.
pub(crate) fn assert_conforms(report: &Value) {
    let id = report["schema"].as_str().expect("the id of a schema");
    let name = format!("{}.json", id.replace('/', "."));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schemas").join(name);
    let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(schema["$id"], id);
    let faults = faults(&schema["$defs"], &schema, report, "");
    assert!(faults.is_empty(), "{id}: {faults:#?}");
}

/// The violations of a schema in a value at a place.
fn faults(defs: &Value, schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let mut all = Vec::new();
    for (keyword, said) in schema.as_object().expect("a schema") {
        let count = value.as_array().map_or(u64::MAX, |items| items.len() as u64);
        let number = value.as_f64();
        let holds = match keyword.as_str() {
            "$schema" | "$id" | "$defs" | "title" | "description" => true,
            "type" => types(said).any(|name| is_a(value, name)),
            "const" => value == said,
            "enum" => said.as_array().expect("values").contains(value),
            "minimum" => number.is_none_or(|n| said.as_f64().is_some_and(|least| n >= least)),
            "maximum" => number.is_none_or(|n| said.as_f64().is_some_and(|most| n <= most)),
            "minItems" => said.as_u64().is_some_and(|least| count >= least),
            "required" => {
                said.as_array().expect("keys").iter().all(|key| value.get(key.as_str().expect("a key")).is_some())
            }
            "additionalProperties" => keys(value).all(|key| schema["properties"].get(key).is_some()),
            "anyOf" => said.as_array().expect("schemas").iter().any(|one| faults(defs, one, value, at).is_empty()),
            "$ref" => {
                let name = said.as_str().and_then(|path| path.strip_prefix("#/$defs/")).expect("a definition");
                all.extend(faults(defs, &defs[name], value, at));
                true
            }
            "properties" => {
                let known = keys(value).filter_map(|key| Some((key, said.get(key)?)));
                all.extend(known.flat_map(|(key, of)| faults(defs, of, &value[key], &format!("{at}/{key}"))));
                true
            }
            "items" => {
                let items = value.as_array().into_iter().flatten().enumerate();
                all.extend(items.flat_map(|(i, item)| faults(defs, said, item, &format!("{at}/{i}"))));
                true
            }
            _ => panic!("the keyword {keyword} is not known"),
        };
        if !holds {
            all.push(format!("{at}: {keyword} {said} does not hold for {value}"));
        }
    }
    all
}

fn types(said: &Value) -> impl Iterator<Item = &str> {
    let several = said.as_array().into_iter().flatten();
    std::iter::once(said).chain(several).filter_map(Value::as_str)
}

fn is_a(value: &Value, name: &str) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        _ => panic!("there is no type {name}"),
    }
}

fn keys(value: &Value) -> impl Iterator<Item = &str> {
    value.as_object().into_iter().flat_map(|object| object.keys().map(String::as_str))
}

#[test]
fn what_a_schema_does_not_say_is_a_fault() {
    let device = serde_json::json!({"schema": "raykiln.devices/1", "raykiln_version": "0", "devices": []});
    assert_conforms(&device);
    for (key, value) in [("devices", Value::Null), ("raykiln_version", 1.into()), ("more", 1.into())] {
        let mut other = device.clone();
        other[key] = value;
        assert!(std::panic::catch_unwind(|| assert_conforms(&other)).is_err(), "{key}");
    }
}
