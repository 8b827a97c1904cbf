//! A value of the pipeline file that may be kept in a file of its own.

use std::borrow::Cow;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A value, or the file that holds it.
#[derive(Debug, Clone, PartialEq)]
pub enum HereOrFile<T> {
    /// The value itself.
    Here(T),
    /// Path of a file, which the reader of the pipeline file replaces by its content.
    File(PathBuf),
}

impl<T> HereOrFile<T> {
    /// Returns the value, unless it is still in its file.
    pub fn here(&self) -> Option<&T> {
        match self {
            Self::Here(value) => Some(value),
            Self::File(_) => None,
        }
    }

    /// Returns a mutable reference to the value, unless it is still in its file.
    pub fn here_mut(&mut self) -> Option<&mut T> {
        match self {
            Self::Here(value) => Some(value),
            Self::File(_) => None,
        }
    }

    /// Returns the file, while it has not been read.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Here(_) => None,
            Self::File(path) => Some(path),
        }
    }
}

impl<T: Serialize> Serialize for HereOrFile<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Here(value) => value.serialize(serializer),
            Self::File(path) => path.serialize(serializer),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for HereOrFile<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Either(PhantomData))
    }
}

/// Visitor that reads a string as a path and a mapping as the value, so that an error in the value has its location.
struct Either<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
    type Value = HereOrFile<T>;

    fn expecting(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        text.write_str("a mapping, or the path of a file")
    }

    fn visit_str<E>(self, path: &str) -> Result<Self::Value, E> {
        Ok(HereOrFile::File(path.into()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(HereOrFile::Here)
    }
}

impl<T: JsonSchema> JsonSchema for HereOrFile<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("{}OrFile", T::schema_name()).into()
    }

    fn schema_id() -> Cow<'static, str> {
        format!("{}::HereOrFile<{}>", module_path!(), T::schema_id()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        // Keywords for mappings do not apply to strings, so no `anyOf` of two schemas is needed. Its error messages
        // could only state that neither schema fits.
        let mut schema = T::json_schema(generator);
        schema.insert("type".to_owned(), serde_json::json!(["object", "string"]));
        schema
    }
}
