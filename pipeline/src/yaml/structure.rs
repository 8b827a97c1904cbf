//! Check of a file's shape against the schema of its type, with readable messages.

use std::sync::Arc;

use jsonschema::ValidationError;
use jsonschema::error::{TypeKind, ValidationErrorKind as Mismatch};
use schemars::JsonSchema;
use serde_json::Value;

use super::place::{Place, Spans};
use crate::report::{Problem, Report, Source};
use crate::suggest;

/// Largest number of mismatches that are reported.
/// Resolution: bounds time; more than a user reads.
const MOST_MISMATCHES: usize = 200;

/// Compares `value` with the schema of `T`.
pub fn check<T: JsonSchema>(source: &Arc<Source>, value: &Value, spans: &Spans) -> Report {
    let schema = schemars::schema_for!(T).to_value();
    let mut report = Report::default();
    match jsonschema::validator_for(&schema) {
        Ok(validator) => {
            let words = Words {
                source,
                spans,
                schema: &schema,
            };
            for error in validator.iter_errors(value) {
                if report.len() >= MOST_MISMATCHES {
                    break;
                }
                words.say(&error, &mut report);
            }
        }
        Err(error) => report.push(Problem::new(format!(
            "the schema of this kind of file is not valid, which is a bug of tauscope: {error}"
        ))),
    }
    report
}

/// Removes every key with a mismatch from `value`, so that the rest can be checked, and returns the removed places.
/// `None` if the rest is still invalid: a key is missing, or the whole has the wrong type.
pub fn prune<T: JsonSchema>(value: &mut Value) -> Option<Vec<Place>> {
    let schema = schemars::schema_for!(T).to_value();
    let validator = jsonschema::validator_for(&schema).ok()?;
    let mut wrong = Vec::new();
    for error in validator.iter_errors(value) {
        let pointer = error.instance_path().as_str().to_owned();
        match error.kind() {
            Mismatch::AdditionalProperties { unexpected }
            | Mismatch::UnevaluatedProperties { unexpected } => {
                wrong.extend(unexpected.iter().map(|key| (pointer.clone(), key.clone())));
            }
            Mismatch::Required { .. } => return None,
            _ => {
                let (parent, key) = pointer.rsplit_once('/')?;
                wrong.push((parent.to_owned(), key.replace("~1", "/").replace("~0", "~")));
            }
        }
    }
    let mut places = Vec::new();
    for (parent, key) in wrong {
        // Items of lists are kept, because removing one would shift the indices of the others.
        if let Some(Value::Object(map)) = value.pointer_mut(&parent) {
            map.remove(&key);
        }
        places.push(Place::from_pointer(&parent).key(&key));
    }
    validator.is_valid(value).then_some(places)
}

/// Readable names of JSON Schema types.
fn type_words(kind: &TypeKind) -> String {
    let names: Vec<&str> = match kind {
        TypeKind::Single(one) => vec![type_word(one.as_str())],
        TypeKind::Multiple(set) => set
            .iter()
            .map(|one| type_word(one.as_str()))
            .filter(|&name| name != "nothing")
            .collect(),
    };
    names.join(" or ")
}

fn type_word(name: &str) -> &'static str {
    match name {
        "array" => "a list",
        "boolean" => "true or false",
        "integer" => "a whole number",
        "null" => "nothing",
        "number" => "a number",
        "object" => "a mapping (`key: value`)",
        _ => "a text",
    }
}

fn found_word(value: &Value) -> String {
    match value {
        Value::Null => "nothing".to_owned(),
        Value::Bool(value) => format!("`{value}`"),
        Value::Number(value) => format!("the number {value}"),
        Value::String(text) => format!("the text `{text}`"),
        Value::Array(_) => "a list".to_owned(),
        Value::Object(_) => "a mapping".to_owned(),
    }
}

struct Words<'a> {
    source: &'a Arc<Source>,
    spans: &'a Spans,
    schema: &'a Value,
}

impl Words<'_> {
    fn say(&self, error: &ValidationError<'_>, report: &mut Report) {
        let place = Place::from_pointer(error.instance_path().as_str());
        match error.kind() {
            Mismatch::AdditionalProperties { unexpected }
            | Mismatch::UnevaluatedProperties { unexpected } => {
                for key in unexpected {
                    report.push(self.unknown_key(error, &place, key));
                }
            }
            Mismatch::Required { property } => {
                let name = property.as_str().unwrap_or_default();
                report.push(self.missing_key(error, &place, name));
            }
            Mismatch::AnyOf { context } | Mismatch::OneOfNotValid { context } => {
                self.alternatives(error, context, report);
            }
            _ => report.push(self.wrong_value(error, &place)),
        }
    }

    fn unknown_key(&self, error: &ValidationError<'_>, place: &Place, key: &str) -> Problem {
        let known = self.keys_at(error);
        Problem::at(
            self.source,
            self.spans.key(&place.key(key)),
            format!("unknown key `{key}`"),
        )
        .maybe_help(suggest::help(
            key,
            "known here are",
            known.iter().map(String::as_str),
        ))
    }

    fn missing_key(&self, error: &ValidationError<'_>, place: &Place, key: &str) -> Problem {
        let inside = place.describe();
        let title = if inside.is_empty() {
            format!("the key `{key}` is missing")
        } else {
            format!("the key `{key}` is missing in `{inside}`")
        };
        let what = self
            .schema_around(error)
            .and_then(|schema| {
                schema
                    .get("properties")?
                    .get(key)?
                    .get("description")?
                    .as_str()
            })
            .map(|text| format!("`{key}`: {}", first_sentence(text)));
        Problem::at(self.source, self.spans.key(place), title).maybe_help(what)
    }

    fn wrong_value(&self, error: &ValidationError<'_>, place: &Place) -> Problem {
        let found = found_word(error.instance());
        let title = match error.kind() {
            Mismatch::Type { kind } => format!("expected {}, found {found}", type_words(kind)),
            Mismatch::Constant { expected_value } => {
                format!("expected {}, found {found}", found_word(expected_value))
            }
            Mismatch::Enum { options } => return self.not_one_of(place, error, &strings(options)),
            Mismatch::Minimum { limit } => format!("expected at least {limit}, found {found}"),
            Mismatch::Maximum { limit } => format!("expected at most {limit}, found {found}"),
            Mismatch::ExclusiveMinimum { limit } => {
                format!("expected more than {limit}, found {found}")
            }
            Mismatch::ExclusiveMaximum { limit } => {
                format!("expected less than {limit}, found {found}")
            }
            Mismatch::MinItems { limit } => format!("expected at least {limit} items"),
            Mismatch::MaxItems { limit } => format!("expected at most {limit} items"),
            Mismatch::MinLength { .. } => "expected a text, found an empty one".to_owned(),
            _ => error.to_string(),
        };
        let key = place.describe();
        let label = if key.is_empty() {
            String::new()
        } else {
            format!("`{key}`")
        };
        Problem::at(self.source, self.spans.value(place), title).label(label)
    }

    fn not_one_of(
        &self,
        place: &Place,
        error: &ValidationError<'_>,
        allowed: &[String],
    ) -> Problem {
        let found = found_word(error.instance());
        let list = suggest::list(allowed.iter().map(String::as_str));
        let title = format!("expected one of {list}, found {found}");
        let nearest = error
            .instance()
            .as_str()
            .and_then(|text| suggest::nearest(text, allowed.iter().map(String::as_str)))
            .map(|word| format!("did you mean `{word}`?"));
        Problem::at(self.source, self.spans.value(place), title).maybe_help(nearest)
    }

    /// Reports a value that matches none of several alternatives. If it resembles one, the mismatches with that one
    /// are reported; otherwise the alternatives are listed.
    fn alternatives(
        &self,
        error: &ValidationError<'_>,
        branches: &[Vec<ValidationError<'static>>],
        report: &mut Report,
    ) {
        let here = error.instance_path().as_str();
        let resembles = |branch: &&Vec<ValidationError<'static>>| {
            !branch.iter().any(|inner| {
                inner.instance_path().as_str() == here
                    && matches!(
                        inner.kind(),
                        Mismatch::Type { .. } | Mismatch::Constant { .. } | Mismatch::Enum { .. }
                    )
            })
        };
        let fewest = branches
            .iter()
            .filter(resembles)
            .min_by_key(|branch| branch.len());
        if let Some(branch) = fewest {
            for inner in branch {
                self.say(inner, report);
            }
            return;
        }
        let mut words = Vec::new();
        let mut types = Vec::new();
        for inner in branches
            .iter()
            .flatten()
            .filter(|inner| inner.instance_path().as_str() == here)
        {
            match inner.kind() {
                Mismatch::Constant { expected_value } => {
                    words.extend(expected_value.as_str().map(str::to_owned));
                }
                Mismatch::Enum { options } => words.extend(strings(options)),
                Mismatch::Type { kind } => types.push(type_words(kind)),
                _ => {}
            }
        }
        let place = Place::from_pointer(here);
        types.retain(|name| !name.is_empty() && name != "nothing");
        // If the allowed texts are listed, "a text" is redundant.
        if !words.is_empty() {
            types.retain(|name| name != "a text");
        }
        types.dedup();
        if types.is_empty() && !words.is_empty() {
            report.push(self.not_one_of(&place, error, &words));
            return;
        }
        let mut expected: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
        expected.append(&mut types);
        let found = found_word(error.instance());
        let title = format!("expected {}, found {found}", expected.join(" or "));
        report.push(Problem::at(self.source, self.spans.value(&place), title));
    }

    /// Keys that the schema allows at the place of `error`.
    fn keys_at(&self, error: &ValidationError<'_>) -> Vec<String> {
        self.schema_around(error)
            .and_then(|schema| schema.get("properties")?.as_object())
            .map(|properties| properties.keys().cloned().collect())
            .unwrap_or_default()
    }

    /// The part of the schema that contains the keyword of `error`.
    fn schema_around(&self, error: &ValidationError<'_>) -> Option<&Value> {
        let path = error.schema_path().as_str();
        let parent = &path[..path.rfind('/')?];
        let mut schema = self.schema;
        for segment in parent.split('/').skip(1) {
            let segment = segment.replace("~1", "/").replace("~0", "~");
            if segment == "$ref" {
                let target = schema.get("$ref")?.as_str()?.strip_prefix('#')?;
                schema = self.schema.pointer(target)?;
                continue;
            }
            schema = match schema {
                Value::Array(items) => items.get(segment.parse::<usize>().ok()?)?,
                other => other.get(&segment)?,
            };
        }
        Some(schema)
    }
}

fn strings(options: &Value) -> Vec<String> {
    let all = options.as_array().map(Vec::as_slice).unwrap_or_default();
    all.iter()
        .filter_map(|option| option.as_str().map(str::to_owned))
        .collect()
}

/// The first sentence of a description, on one line.
fn first_sentence(text: &str) -> String {
    let text = text.replace('\n', " ").replace(['\\'], "");
    match text.find(". ") {
        Some(end) => text[..=end].to_owned(),
        None => text,
    }
}
