//! The schemas and the page of the file formats agree with the loaders.

use host_fit::data::DataSet;
use host_fit::model::Model;
use model_core::effects::LAWS;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).expect("a file of the project")
}

fn schema(name: &str) -> Value {
    serde_json::from_str(&read(&format!("docs/schema/{name}.schema.json"))).expect("JSON")
}

fn parsed(text: &str) -> Value {
    let table: toml::Table = text.parse().expect("TOML");
    serde_json::to_value(table).expect("JSON")
}

/// Whether `value` fits `schema`; only the keywords that our schemas contain are checked.
fn fits(schema: &Value, value: &Value) -> bool {
    if let Some(choices) = schema["oneOf"].as_array() {
        return choices.iter().filter(|choice| fits(choice, value)).count() == 1;
    }
    if let Some(constant) = schema.get("const") {
        return value == constant;
    }
    if let Some(choices) = schema["enum"].as_array() {
        return choices.contains(value);
    }
    match schema["type"].as_str() {
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("number") => value.as_f64().is_some_and(|x| {
            schema["exclusiveMinimum"]
                .as_f64()
                .is_none_or(|least| x > least)
        }),
        Some("integer") => value.as_i64().is_some_and(|x| {
            schema["minimum"].as_i64().is_none_or(|least| x >= least)
                && schema["maximum"].as_i64().is_none_or(|most| x <= most)
        }),
        Some("array") => value.as_array().is_some_and(|items| {
            let count = items.len() as u64;
            items.iter().all(|item| fits(&schema["items"], item))
                && schema["minItems"]
                    .as_u64()
                    .is_none_or(|least| count >= least)
                && schema["maxItems"].as_u64().is_none_or(|most| count <= most)
        }),
        Some("object") => value
            .as_object()
            .is_some_and(|table| object_fits(schema, table)),
        _ => panic!("no keyword of ours: {schema}"),
    }
}

fn object_fits(schema: &Value, table: &Map<String, Value>) -> bool {
    let Some(properties) = schema["properties"].as_object() else {
        return true;
    };
    let needed = schema["required"].as_array().expect("a list");
    let has = |key: &Value| key.as_str().is_some_and(|key| table.contains_key(key));
    let known =
        |(key, value): (&String, &Value)| properties.get(key).is_some_and(|own| fits(own, value));
    needed.iter().all(has) && table.iter().all(known)
}

/// `value` with every key of every table left out once, and an unknown key added once.
fn changed(value: &Value) -> Vec<(String, Value)> {
    let mut all = Vec::new();
    match value {
        Value::Object(table) => {
            let mut strange = table.clone();
            strange.insert("strange".to_owned(), json!(1));
            all.push(("strange".to_owned(), Value::Object(strange)));
            for (key, inner) in table {
                let mut without = table.clone();
                without.remove(key);
                all.push((key.clone(), Value::Object(without)));
                for (path, inner) in changed(inner) {
                    let mut with = table.clone();
                    with.insert(key.clone(), inner);
                    all.push((format!("{key}.{path}"), Value::Object(with)));
                }
            }
        }
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                for (path, inner) in changed(item) {
                    let mut with = items.clone();
                    with[i] = inner;
                    all.push((path, Value::Array(with)));
                }
            }
        }
        _ => {}
    }
    all
}

fn as_toml(value: &Value) -> String {
    toml::to_string(value).expect("TOML")
}

/// Keys that depend on other keys, which a schema cannot state: the parameters of a law or an effect.
fn depends(path: &str) -> bool {
    [
        "delay.",
        "parameters",
        "channel",
        "reference",
        "effect.",
        "definition",
    ]
    .iter()
    .any(|part| path.contains(part) && !path.ends_with("law"))
}

#[test]
fn the_schema_of_models_takes_what_the_loader_takes() {
    let schema = schema("model");
    let mut files = Vec::new();
    for folder in ["data/paper", "firmware/identified/models"] {
        for entry in std::fs::read_dir(root().join(folder)).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|e| e == "toml")
                && path.file_stem().is_some_and(|s| s != "rig")
            {
                files.push(path);
            }
        }
    }
    assert!(files.len() >= 9);
    let mut refused = 0;
    for path in files {
        let model = Model::load(&path).expect("a model");
        for text in [
            std::fs::read_to_string(&path).expect("text"),
            model.to_toml(),
        ] {
            let value = parsed(&text);
            assert!(fits(&schema, &value), "{}", path.display());
            for (key, other) in changed(&value).into_iter().filter(|(key, _)| !depends(key)) {
                let loads = Model::from_toml(&as_toml(&other), "changed").is_ok();
                assert_eq!(fits(&schema, &other), loads, "{}: {key}", path.display());
                refused += usize::from(!loads);
            }
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn every_delay_law_is_in_the_schema() {
    let delay = &schema("model")["properties"]["delay"]["properties"];
    for spec in LAWS {
        let name = spec.name.trim_end_matches("-delay");
        let laws = delay["law"]["enum"].as_array().expect("a list");
        assert!(laws.contains(&json!(name)), "{name}");
        for parameter in spec.parameters {
            assert!(delay.get(parameter.name).is_some(), "{}", parameter.name);
        }
    }
}

#[test]
fn the_schema_of_data_sets_takes_what_the_loader_takes() {
    let schema = schema("dataset");
    let folder = root().join("data/paper-like");
    let copy = tempfile::tempdir().expect("a folder");
    for entry in std::fs::read_dir(&folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, copy.path().join(path.file_name().expect("a name"))).expect("a copy");
    }
    let loads = |value: &Value| {
        std::fs::write(copy.path().join("dataset.toml"), as_toml(value)).expect("written");
        DataSet::load(copy.path()).is_ok()
    };
    let mut value = parsed(&read("data/paper-like/dataset.toml"));
    value["record"][0]["u_before"] = json!(0.0);
    value["record"][0]["lead_samples"] = json!(2);
    value["title"] = json!("a title");
    assert!(fits(&schema, &value) && loads(&value));
    for (key, other) in changed(&value) {
        // A data set without records is refused for another reason than its keys.
        if key != "record" {
            assert_eq!(fits(&schema, &other), loads(&other), "{key}");
        }
    }
}

/// Keys of a schema, the inner ones too.
fn keys(schema: &Value, found: &mut Vec<String>) {
    if let Some(properties) = schema["properties"].as_object() {
        for (key, inner) in properties {
            found.push(key.clone());
            keys(inner, found);
        }
    }
    keys_of_items(schema, found);
}

fn keys_of_items(schema: &Value, found: &mut Vec<String>) {
    if schema["items"].is_object() {
        keys(&schema["items"], found);
    }
    for choice in schema["oneOf"].as_array().into_iter().flatten() {
        keys(choice, found);
    }
}

#[test]
fn every_key_is_on_the_page() {
    let pages = read("docs/format.md") + &read("docs/user-effects.md");
    for name in ["model", "dataset"] {
        let mut found = Vec::new();
        keys(&schema(name), &mut found);
        assert!(found.len() > 8);
        for key in found {
            let written = [
                format!(".{key}`"),
                format!("`{key}`"),
                format!("`[[{key}]]`"),
                format!("`{key}[]"),
                format!("`{key}."),
                format!(".{key}."),
            ];
            assert!(written.iter().any(|w| pages.contains(w)), "{key}");
        }
    }
}
