//! All keys of a kind of file as Markdown tables, generated from its schema so that they agree with the types.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;

use serde_json::{Map, Value};

/// One part of a file: its path and its schema.
struct Part<'a> {
    path: String,
    schema: &'a Map<String, Value>,
}

/// State of a walk through a schema.
struct Walk<'a> {
    definitions: Option<&'a Map<String, Value>>,
    /// Path of the first use of each definition.
    told: BTreeMap<&'a str, String>,
    waiting: VecDeque<Part<'a>>,
}

/// Keys of a file with this schema: for each part a heading of this level with its path, and a table. In a path, `[]`
/// stands for each element of a list and `*` for each name.
pub fn keys(schema: &Value, level: usize) -> String {
    let mut text = String::new();
    let Some(top) = schema.as_object() else {
        return text;
    };
    let mut walk = Walk {
        definitions: schema.get("$defs").and_then(Value::as_object),
        told: BTreeMap::new(),
        waiting: VecDeque::new(),
    };
    walk.waiting.push_back(Part {
        path: String::new(),
        schema: top,
    });
    while let Some(part) = walk.waiting.pop_front() {
        let heading = if part.path.is_empty() {
            "the file"
        } else {
            &format!("`{}`", part.path)
        };
        let about = wrapped(&description(part.schema));
        let hashes = "#".repeat(level);
        let table = walk.table(&part);
        let _ = write!(text, "{hashes} {heading}\n\n{about}\n\n{table}\n");
    }
    text.truncate(text.trim_end().len());
    text
}

impl<'a> Walk<'a> {
    /// Table of a part; nested parts are queued for their own tables.
    fn table(&mut self, part: &Part<'a>) -> String {
        let mut table =
            String::from("| key | value | default | meaning |\n| --- | --- | --- | --- |\n");
        let required = part.schema.get("required").and_then(Value::as_array);
        let is_required = |key: &str| {
            required.is_some_and(|keys| keys.iter().any(|required| required.as_str() == Some(key)))
        };
        for (key, value) in properties(part.schema).into_iter().flatten() {
            let path = match part.path.as_str() {
                "" => key.clone(),
                above => format!("{above}.{key}"),
            };
            let mut meaning = value.as_object().map(description).unwrap_or_default();
            if let Some(elsewhere) = self.go_down(value, &path) {
                let _ = write!(meaning, " The same keys as `{elsewhere}`.");
            }
            let default = match value.get("default") {
                _ if is_required(key) => "required".to_owned(),
                None | Some(Value::Null) => String::new(),
                Some(Value::Object(none)) if none.is_empty() => String::new(),
                Some(Value::Object(_)) => "its defaults".to_owned(),
                Some(default) => format!("`{}`", default.to_string().replace('"', "")),
            };
            let kind = self.kind(value);
            let cells = [&format!("`{key}`"), &kind, &default, &meaning];
            let cells = cells.map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(table, "| {} |", cells.join(" | "));
        }
        table
    }

    /// Queues the objects in a value for their own tables. Returns the path of the first use of an already described
    /// one.
    fn go_down(&mut self, value: &'a Value, path: &str) -> Option<String> {
        let schema = value.as_object()?;
        if let Some(name) = reference(schema) {
            let target = self.definition(name)?;
            if properties(target).is_none() {
                return self.go_down_into_parts(target, path);
            }
            if let Some(elsewhere) = self.told.get(name) {
                return Some(elsewhere.clone());
            }
            self.told.insert(name, path.to_owned());
            self.waiting.push_back(Part {
                path: path.to_owned(),
                schema: target,
            });
            return None;
        }
        if properties(schema).is_some() {
            self.waiting.push_back(Part {
                path: path.to_owned(),
                schema,
            });
            return None;
        }
        self.go_down_into_parts(schema, path)
    }

    fn go_down_into_parts(&mut self, schema: &'a Map<String, Value>, path: &str) -> Option<String> {
        if let Some(items) = schema.get("items") {
            return self.go_down(items, &format!("{path}[]"));
        }
        if let Some(named) = schema
            .get("additionalProperties")
            .filter(|it| it.is_object())
        {
            return self.go_down(named, &format!("{path}.*"));
        }
        let choices = schema.get("anyOf").or(schema.get("oneOf"))?.as_array()?;
        let told = choices.iter().map(|choice| self.go_down(choice, path));
        told.collect::<Vec<_>>().into_iter().flatten().next()
    }

    fn definition(&self, name: &str) -> Option<&'a Map<String, Value>> {
        self.definitions?.get(name)?.as_object()
    }

    /// Allowed values, in words.
    fn kind(&self, value: &Value) -> String {
        let Some(schema) = value.as_object() else {
            return "anything".to_owned();
        };
        if let Some(target) = reference(schema).and_then(|name| self.definition(name)) {
            return match target.get("type") {
                Some(Value::String(kind)) if kind == "object" => "keys".to_owned(),
                _ => self.kind(&Value::Object(target.clone())),
            };
        }
        if let Some(only) = schema.get("const").and_then(Value::as_str) {
            return format!("`{only}`");
        }
        if let Some(some) = schema.get("enum").and_then(Value::as_array) {
            return one_of(
                some.iter()
                    .filter_map(Value::as_str)
                    .map(|it| format!("`{it}`")),
            );
        }
        if let Some(choices) = schema
            .get("anyOf")
            .or(schema.get("oneOf"))
            .and_then(Value::as_array)
        {
            let choices = choices.iter().filter(|choice| !is_null(choice));
            return one_of(choices.map(|choice| self.kind(choice)));
        }
        let kinds: Vec<&str> = match schema.get("type") {
            Some(Value::String(kind)) => vec![kind],
            Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
            _ => return "anything".to_owned(),
        };
        let kinds = kinds.into_iter().filter(|kind| *kind != "null");
        one_of(kinds.map(|kind| self.plain(kind, schema)))
    }

    fn plain(&self, kind: &str, schema: &Map<String, Value>) -> String {
        match kind {
            "number" | "integer" => {
                let bound = |key: &str| schema.get(key).map(Value::to_string);
                let kind = if kind == "integer" {
                    "whole number"
                } else {
                    kind
                };
                let from = bound("minimum").map(|from| format!(", {from} or more"));
                let above = bound("exclusiveMinimum").map(|above| format!(", more than {above}"));
                let to = bound("maximum").map(|to| format!(", at most {to}"));
                [Some(kind.to_owned()), from, above, to]
                    .into_iter()
                    .flatten()
                    .collect()
            }
            "string" => "text".to_owned(),
            "boolean" => "`true` or `false`".to_owned(),
            "array" => match schema.get("items") {
                Some(items) => format!("list: {}", self.kind(items)),
                None => "list".to_owned(),
            },
            "object" => match schema
                .get("additionalProperties")
                .filter(|it| it.is_object())
            {
                Some(named) => format!("by name: {}", self.kind(named)),
                None => "keys".to_owned(),
            },
            other => other.to_owned(),
        }
    }
}

fn is_null(schema: &Value) -> bool {
    schema.get("type").and_then(Value::as_str) == Some("null")
}

fn properties(schema: &Map<String, Value>) -> Option<&Map<String, Value>> {
    schema.get("properties").and_then(Value::as_object)
}

/// Name of the definition that a schema refers to.
fn reference(schema: &Map<String, Value>) -> Option<&str> {
    schema.get("$ref")?.as_str()?.strip_prefix("#/$defs/")
}

/// Description on one line.
fn description(schema: &Map<String, Value>) -> String {
    let text = schema.get("description").and_then(Value::as_str);
    let words = text.unwrap_or_default().replace('\\', "");
    words.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Wraps the text at the line width of an editor.
fn wrapped(text: &str) -> String {
    const WIDTH: usize = 120;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}

fn one_of(choices: impl Iterator<Item = String>) -> String {
    let choices: Vec<String> = choices.collect();
    match &choices[..] {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}
