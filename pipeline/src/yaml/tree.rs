//! Parser from YAML text to a value and the places of its parts.
//!
//! It is built on the events of the YAML parser instead of its tree: duplicate keys are found with both places, and
//! depth and aliases are bounded, so that a malicious file is an error and not a hang.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use saphyr::{Scalar, ScalarStyle, Tag};
use saphyr_parser::{Event, Parser, ScanError, Span};
use serde_json::{Map, Number, Value};

use super::place::{Place, Spans};
use crate::report::{Problem, Report, Source};

/// Largest nesting depth, above that of any valid file.
/// Resolution: bounds the stack.
const DEEPEST: usize = 64;
/// Largest number of mappings, that of a pipeline for a thousand cells.
/// Resolution: bounds time.
const MOST_MAPPINGS: usize = 20_000;
/// Largest number of nodes that aliases may add.
/// Resolution: bounds memory and time.
const MOST_ALIASED_NODES: usize = 10_000;

/// Parses the one document in `source`.
///
/// # Errors
/// Invalid YAML, or content that no schema allows.
pub fn parse(source: &Arc<Source>) -> Result<(Value, Spans), Report> {
    let mut builder = Builder::new(source);
    for event in Parser::new_from_str(&source.text) {
        let step = match event {
            Ok((event, span)) => {
                let span = builder.offsets.range(span);
                builder.take(event, span)
            }
            Err(error) => Err(builder.not_yaml(&error)),
        };
        if let Err(problem) = step {
            builder.report.push(problem);
            break;
        }
    }
    let Builder { report, root, .. } = builder;
    let root = report.into_result(root)?;
    let Some(root) = root else {
        return Err(Problem::at(source, 0..0, "the file is empty").into());
    };
    let mut spans = Spans::default();
    let value = convert(root, &Place::root(), None, &mut spans);
    Ok((value, spans))
}

/// A node of the document.
#[derive(Clone)]
struct Node {
    span: Range<usize>,
    /// Number of nodes in it, including itself.
    size: usize,
    kind: Kind,
}

#[derive(Clone)]
enum Kind {
    Scalar(Value),
    Sequence(Vec<Node>),
    Mapping(Vec<(Key, Node)>),
}

#[derive(Clone)]
struct Key {
    text: String,
    span: Range<usize>,
}

/// A collection that is not yet complete.
struct Open {
    start: usize,
    anchor: usize,
    size: usize,
    items: Items,
}

enum Items {
    Sequence(Vec<Node>),
    Mapping {
        entries: Vec<(Key, Node)>,
        key: Option<Key>,
    },
}

struct Builder<'a> {
    source: &'a Arc<Source>,
    offsets: Offsets,
    open: Vec<Open>,
    anchors: HashMap<usize, Node>,
    aliased: usize,
    mappings: usize,
    documents: usize,
    root: Option<Node>,
    report: Report,
}

impl<'a> Builder<'a> {
    fn new(source: &'a Arc<Source>) -> Self {
        Self {
            source,
            offsets: Offsets::new(&source.text),
            open: Vec::new(),
            anchors: HashMap::new(),
            aliased: 0,
            mappings: 0,
            documents: 0,
            root: None,
            report: Report::default(),
        }
    }

    fn problem(&self, span: Range<usize>, title: impl Into<String>) -> Problem {
        Problem::at(self.source, span, title)
    }

    fn take(&mut self, event: Event<'_>, span: Range<usize>) -> Result<(), Problem> {
        match event {
            Event::DocumentStart(_) => {
                self.documents += 1;
                if self.documents > 1 {
                    return Err(self
                        .problem(span, "a second document begins here")
                        .help("a file holds one document: remove the line `---`"));
                }
                Ok(())
            }
            Event::SequenceStart(anchor, _) => {
                self.begin(span, anchor, Items::Sequence(Vec::new()))
            }
            Event::MappingStart(..) if self.mappings >= MOST_MAPPINGS => {
                let title = format!("more than {MOST_MAPPINGS} mappings, which is the limit");
                Err(self
                    .problem(span, title)
                    .help("divide the file, or give the large part as a file of its own"))
            }
            Event::MappingStart(anchor, _) => self.begin(
                span,
                anchor,
                Items::Mapping {
                    entries: Vec::new(),
                    key: None,
                },
            ),
            Event::SequenceEnd | Event::MappingEnd => {
                self.finish(span.start);
                Ok(())
            }
            Event::Scalar(text, style, anchor, tag) => {
                self.scalar(text, style, anchor, tag.as_ref(), span)
            }
            Event::Alias(anchor) => self.alias(anchor, span),
            Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentEnd => Ok(()),
        }
    }

    fn begin(&mut self, span: Range<usize>, anchor: usize, items: Items) -> Result<(), Problem> {
        if self.awaits_key() {
            return Err(self.problem(span, "a key must be a word, not a list or a mapping"));
        }
        if self.open.len() == DEEPEST {
            return Err(self.problem(span, format!("nested deeper than {DEEPEST} levels")));
        }
        self.mappings += usize::from(matches!(items, Items::Mapping { .. }));
        self.open.push(Open {
            start: span.start,
            anchor,
            size: 1,
            items,
        });
        Ok(())
    }

    fn finish(&mut self, end: usize) {
        let Some(Open {
            start,
            anchor,
            size,
            items,
        }) = self.open.pop()
        else {
            return;
        };
        let kind = match items {
            Items::Sequence(items) => Kind::Sequence(items),
            Items::Mapping { entries, .. } => Kind::Mapping(entries),
        };
        let span = self.first_line(start, end);
        self.add(Node { span, size, kind }, anchor);
    }

    fn scalar(
        &mut self,
        text: Cow<'_, str>,
        style: ScalarStyle,
        anchor: usize,
        tag: Option<&Cow<'_, Tag>>,
        span: Range<usize>,
    ) -> Result<(), Problem> {
        if self.awaits_key() {
            self.key(Key {
                text: text.into_owned(),
                span,
            });
            return Ok(());
        }
        let value = match Scalar::parse_from_cow_and_metadata(text, style, tag) {
            Some(Scalar::Null) => Value::Null,
            Some(Scalar::Boolean(value)) => Value::Bool(value),
            Some(Scalar::Integer(value)) => Value::from(value),
            Some(Scalar::FloatingPoint(value)) => match Number::from_f64(value.into_inner()) {
                Some(number) => Value::Number(number),
                None => return Err(self.problem(span, "not a finite number")),
            },
            Some(Scalar::String(text)) => Value::String(text.into_owned()),
            None => return Err(self.problem(span, "the value is not what its tag says")),
        };
        self.add(
            Node {
                span,
                size: 1,
                kind: Kind::Scalar(value),
            },
            anchor,
        );
        Ok(())
    }

    fn alias(&mut self, anchor: usize, span: Range<usize>) -> Result<(), Problem> {
        if self.awaits_key() {
            return Err(self.problem(span, "a key must be a word, not an alias"));
        }
        let Some(node) = self.anchors.get(&anchor) else {
            return Err(self.problem(span, "an alias to something that contains it"));
        };
        self.aliased += node.size;
        if self.aliased > MOST_ALIASED_NODES {
            let title = format!("aliases expand to more than {MOST_ALIASED_NODES} values");
            return Err(self.problem(span, title));
        }
        let node = Node {
            span,
            ..node.clone()
        };
        self.add(node, 0);
        Ok(())
    }

    fn awaits_key(&self) -> bool {
        matches!(
            self.open.last(),
            Some(Open {
                items: Items::Mapping { key: None, .. },
                ..
            })
        )
    }

    fn key(&mut self, new: Key) {
        let Some(Open {
            items: Items::Mapping { entries, key },
            ..
        }) = self.open.last_mut()
        else {
            return;
        };
        if let Some((first, _)) = entries.iter().find(|(known, _)| known.text == new.text) {
            let title = format!("the key `{}` stands here twice", new.text);
            self.report.push(
                Problem::at(self.source, new.span.clone(), title)
                    .label("the second time")
                    .also(first.span.clone(), "the first time"),
            );
        }
        *key = Some(new);
    }

    /// Adds a finished node to its enclosing collection.
    fn add(&mut self, node: Node, anchor: usize) {
        if anchor > 0 {
            self.anchors.insert(anchor, node.clone());
        }
        let Some(open) = self.open.last_mut() else {
            self.root = Some(node);
            return;
        };
        open.size += node.size;
        match &mut open.items {
            Items::Sequence(items) => items.push(node),
            Items::Mapping { entries, key } => {
                if let Some(key) = key.take() {
                    entries.push((key, node));
                }
            }
        }
    }

    /// First line of a collection, which marks it in a report more clearly than its full text.
    fn first_line(&self, start: usize, end: usize) -> Range<usize> {
        let text = &self.source.text[start..end.max(start)];
        let line = text.lines().next().unwrap_or("");
        let line = line.split(" #").next().unwrap_or(line).trim_end();
        start..start + line.len()
    }

    fn not_yaml(&self, error: &ScanError) -> Problem {
        let at = self.offsets.byte(error.marker().index());
        let text = &self.source.text;
        let end = text[at..]
            .chars()
            .next()
            .map_or(at, |c| if c == '\n' { at } else { at + c.len_utf8() });
        let problem = Problem::at(self.source, at..end, "not valid YAML").label(error.info());
        let line_start = text[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let line = text[line_start..].lines().next().unwrap_or("");
        let indent = &line[..line.len() - line.trim_start().len()];
        if indent.contains('\t') {
            return problem.help("YAML does not allow tabs to indent: use spaces");
        }
        problem
    }
}

/// Converts a node to a value and records the places of its parts. Its depth is bounded by [`DEEPEST`].
fn convert(node: Node, place: &Place, key: Option<Range<usize>>, spans: &mut Spans) -> Value {
    spans.insert(place.clone(), key, node.span);
    match node.kind {
        Kind::Scalar(value) => value,
        Kind::Sequence(items) => items
            .into_iter()
            .enumerate()
            .map(|(index, item)| convert(item, &place.index(index), None, spans))
            .collect(),
        Kind::Mapping(entries) => {
            let mut map = Map::new();
            for (key, value) in entries {
                let place = place.key(&key.text);
                let value = convert(value, &place, Some(key.span), spans);
                map.insert(key.text, value);
            }
            Value::Object(map)
        }
    }
}

/// Conversion from the parser's character offsets to byte offsets.
struct Offsets {
    /// Byte offset of every character, and of the end; empty for an ASCII text.
    bytes: Vec<usize>,
    length: usize,
}

impl Offsets {
    fn new(text: &str) -> Self {
        let bytes = if text.is_ascii() {
            Vec::new()
        } else {
            text.char_indices()
                .map(|(at, _)| at)
                .chain([text.len()])
                .collect()
        };
        Self {
            bytes,
            length: text.len(),
        }
    }

    fn byte(&self, character: usize) -> usize {
        if self.bytes.is_empty() {
            return character.min(self.length);
        }
        self.bytes.get(character).copied().unwrap_or(self.length)
    }

    fn range(&self, span: Span) -> Range<usize> {
        let start = self.byte(span.start.index());
        start..self.byte(span.end.index()).max(start)
    }
}
