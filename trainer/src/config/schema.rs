//! The JSON schema of a configuration, for editors and for reading.

use super::run::Config;
use super::sources::EXTENDS;
use serde_json::json;

/// The JSON schema (draft 2020-12) of a configuration file: every key with meaning, type and default.
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Config).to_value();
    // Resolved before a configuration is read, so that the type does not know it.
    schema["properties"][EXTENDS] = json!({
        "description": "Another configuration that this one starts from, relative to its folder; keys required below may \
            then be missing. Tables are merged, everything else replaces.",
        "type": ["string", "null"],
    });
    schema
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// Calls `visit` for every property of every object of the schema, with the list of required keys beside it.
    fn properties(node: &Value, path: &str, visit: &mut impl FnMut(&str, &Value, bool)) {
        if let Some(properties) = node["properties"].as_object() {
            let required = node["required"].as_array().cloned().unwrap_or_default();
            for (key, property) in properties {
                visit(&format!("{path}.{key}"), property, required.contains(&Value::from(key.as_str())));
            }
        }
        match node {
            Value::Object(map) => map.iter().for_each(|(k, v)| properties(v, &format!("{path}/{k}"), visit)),
            Value::Array(list) => list.iter().for_each(|v| properties(v, path, visit)),
            _ => {}
        }
    }

    #[test]
    fn every_key_has_a_meaning_and_a_default_or_is_required() {
        let (mut count, mut bare) = (0, Vec::new());
        properties(&schema(), "", &mut |path, property, required| {
            count += 1;
            let described = property["description"].as_str().is_some_and(|d| d.len() > 3);
            // An absent optional value has no default to show.
            let optional = property.to_string().contains("null");
            if !described || !(required || optional || property.get("default").is_some()) {
                bare.push(path.to_owned());
            }
        });
        assert!(count > 60, "{count}");
        assert!(bare.is_empty(), "{bare:#?}");
    }

    #[test]
    fn the_schema_knows_the_keys_that_serde_knows() {
        let text = schema().to_string();
        for key in [
            "layer_curriculum",
            "ema_decay",
            "spike_factor",
            "max_self_intersection",
            "siren_width",
            "t_shirt",
        ] {
            assert!(text.contains(key), "{key}");
        }
    }
}
