//! File formats of a [`Config`] and of the state that a detector learns while running.

use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Config;
use crate::detectors::{DETECTORS, Entry};
use crate::frame::{AnySettings, State, Threshold};

/// The keys in addition to those of the detectors.
const THRESHOLD: &str = "threshold";
const HOLD_S: &str = "hold_s";

/// All keys.
static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let detectors = DETECTORS.iter().map(|entry| entry.name);
    detectors.chain([THRESHOLD, HOLD_S]).collect()
});

impl Serialize for Config {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let given = &self.detectors.0;
        let mut map = serializer.serialize_map(Some(given.len() + 2))?;
        for settings in given {
            map.serialize_entry(settings.name(), &**settings)?;
        }
        map.serialize_entry(THRESHOLD, &self.threshold)?;
        map.serialize_entry(HOLD_S, &self.hold_s)?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Config {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("Config", &KEYS, Keys)
    }
}

/// Visitor that reads the keys of a [`Config`].
struct Keys;

impl<'de> Visitor<'de> for Keys {
    type Value = Config;

    fn expecting(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        text.write_str("struct Config")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Config, A::Error> {
        let (mut config, mut threshold, mut hold_s) = (Config::default(), None, None);
        let mut seen: Vec<&'static str> = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            let Some(&known) = KEYS.iter().find(|known| **known == key) else {
                return Err(A::Error::unknown_field(&key, &KEYS));
            };
            if seen.contains(&known) {
                return Err(A::Error::duplicate_field(known));
            }
            seen.push(known);
            match Entry::find(known) {
                Some(entry) => {
                    if let Some(settings) = map.next_value_seed(Optional(entry))? {
                        config = config.with_any(settings);
                    }
                }
                None if known == THRESHOLD => threshold = Some(map.next_value()?),
                None => hold_s = Some(map.next_value()?),
            }
        }
        config.threshold = threshold.unwrap_or(config.threshold);
        config.hold_s = hold_s.unwrap_or(config.hold_s);
        Ok(config)
    }
}

/// The settings of a detector, or null.
struct Optional(&'static Entry);

impl<'de> DeserializeSeed<'de> for Optional {
    type Value = Option<Box<dyn AnySettings>>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let mut deserializer = <dyn erased_serde::Deserializer<'_>>::erase(deserializer);
        (self.0.read)(&mut deserializer).map_err(D::Error::custom)
    }
}

/// A detector: exactly one of the detectors' keys, and the settings that all detectors share.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "Config")]
struct Shared {
    /// Alarm threshold.
    threshold: Threshold,
    /// Time for which the score must stay below the threshold before an alarm ends \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    hold_s: f64,
}

impl Default for Shared {
    fn default() -> Self {
        let Config {
            threshold, hold_s, ..
        } = Config::default();
        Self { threshold, hold_s }
    }
}

impl JsonSchema for Config {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Config".into()
    }

    fn schema_id() -> std::borrow::Cow<'static, str> {
        concat!(module_path!(), "::Config").into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let detectors: Vec<(&str, Schema)> = (DETECTORS.iter())
            .map(|entry| {
                let mut schema = (entry.schema)(generator);
                schema.insert("description".to_owned(), entry.about.into());
                (entry.name, schema)
            })
            .collect();
        let mut schema = Shared::json_schema(generator);
        if let Some(properties) = (schema.get_mut("properties")).and_then(|all| all.as_object_mut())
        {
            for (name, schema) in detectors {
                properties.insert(name.to_owned(), schema.into());
            }
        }
        schema
    }
}

/// The state that a detector learns while running, kept in a file between runs. Its schema is that of the detectors
/// that learn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StateFile(pub State);

impl JsonSchema for StateFile {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "StateFile".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let states = DETECTORS
            .iter()
            .filter_map(|entry| (entry.state_schema)(generator));
        let mut states: Vec<Schema> = states.collect();
        match (states.pop(), &*states) {
            (Some(only), []) => only,
            (last, _) => {
                states.extend(last);
                schemars::json_schema!({ "anyOf": states })
            }
        }
    }
}
