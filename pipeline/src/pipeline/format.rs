//! Formats of a stage's entry in the pipeline file and of its settings, with the keys of the table of stages.

use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::stage::entry::{Common, Part, StageEntry};
use super::stage::{AnyConfig, Kind, Settings};
use super::stages::STAGES;

/// Keys that define the kind of a stage: those of the table, then the former ones.
static KIND_KEYS: LazyLock<Vec<(&'static str, &'static Kind)>> = LazyLock::new(|| {
    let former = STAGES
        .iter()
        .filter_map(|kind| Some((kind.former_key?, kind)));
    STAGES
        .iter()
        .map(|kind| (kind.key, kind))
        .chain(former)
        .collect()
});

impl<'de> Deserialize<'de> for StageEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Entry)
    }
}

/// Visitor that reads the keys of a [`StageEntry`].
struct Entry;

impl<'de> Visitor<'de> for Entry {
    type Value = StageEntry;

    fn expecting(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        text.write_str("struct StageEntry")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<StageEntry, A::Error> {
        let mut parts = Vec::new();
        let rest = CommonKeys {
            map,
            parts: &mut parts,
        };
        let common = Common::deserialize(MapAccessDeserializer::new(rest))?;
        // In the order of the table, whatever the order of the map.
        parts.sort_by_key(|part| KIND_KEYS.iter().position(|(key, _)| *key == part.key));
        Ok(StageEntry { common, parts })
    }
}

/// The keys that all stages have; those that define a kind go to `parts`.
struct CommonKeys<'a, A> {
    map: A,
    parts: &'a mut Vec<Part>,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for CommonKeys<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        while let Some(key) = self.map.next_key::<String>()? {
            let Some((key, kind)) = KIND_KEYS.iter().find(|(known, _)| *known == key) else {
                return seed.deserialize(StrDeserializer::new(&key)).map(Some);
            };
            if self.parts.iter().any(|part| part.key == *key) {
                return Err(A::Error::duplicate_field(key));
            }
            if let Some(config) = self.map.next_value_seed(Optional(kind))? {
                self.parts.push(Part { key, config });
            }
        }
        Ok(None)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
    }
}

/// The part of one kind, or null.
struct Optional(&'static Kind);

impl<'de> DeserializeSeed<'de> for Optional {
    type Value = Option<Box<dyn AnyConfig>>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let mut deserializer = <dyn erased_serde::Deserializer<'_>>::erase(deserializer);
        (self.0.read)(&mut deserializer).map_err(D::Error::custom)
    }
}

impl JsonSchema for StageEntry {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "StageEntry".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Common::json_schema(generator);
        let keys: Vec<String> = STAGES
            .iter()
            .map(|kind| format!("`{}`", kind.key))
            .collect();
        if let (Some((last, others)), Some(properties)) = (
            keys.split_last(),
            schema
                .get_mut("properties")
                .and_then(|all| all.as_object_mut()),
        ) {
            for (key, kind) in KIND_KEYS.iter() {
                let about = if *key == kind.key {
                    kind.about.to_owned()
                } else {
                    let now = kind.key;
                    format!("Former name of `{now}`. `check` and `run` print the edit.")
                };
                let mut part = (kind.schema)(generator);
                part.insert("default".to_owned(), serde_json::Value::Null);
                part.insert("description".to_owned(), about.into());
                properties.insert((*key).to_owned(), part.into());
            }
            let about = format!(
                "A stage: its name, its host and process, its inputs, and exactly one of {} and {last}, which \
                 defines its kind.",
                others.join(", ")
            );
            schema.insert("description".to_owned(), about.into());
        }
        schema
    }
}

impl<'de> Deserialize<'de> for Settings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (key, value) = <(String, serde_json::Value)>::deserialize(deserializer)?;
        let kind = STAGES.iter().find(|kind| kind.key == key);
        let kind = kind.ok_or_else(|| D::Error::custom(format!("there is no stage `{key}`")))?;
        (kind.settings)(value).map_err(D::Error::custom)
    }
}
