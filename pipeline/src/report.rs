//! Error reports about files: all problems together, each with its place, in the format of rustc.

use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use serde::Serialize;

/// The text of a file, with its path.
#[derive(Debug)]
pub struct Source {
    /// The path as the user would write it.
    pub path: String,
    /// The whole text.
    pub text: String,
}

impl Source {
    /// Creates a source from the `text` of `path`.
    pub fn new(path: &Path, text: String) -> Arc<Self> {
        Arc::new(Self {
            path: path.display().to_string(),
            text,
        })
    }
}

/// A place in a [`Source`] with a message.
#[derive(Debug, Clone)]
struct Label {
    span: Range<usize>,
    text: String,
}

/// A problem in a file or in the arguments.
#[derive(Debug, Clone)]
pub struct Problem {
    title: String,
    source: Option<Arc<Source>>,
    /// The first label marks the problem, the others mark conflicting places.
    labels: Vec<Label>,
    /// Path of a file without text, such as an unreadable one.
    path: Option<String>,
    help: Option<String>,
}

impl Problem {
    /// Creates a problem without a place in a file.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            source: None,
            labels: Vec::new(),
            path: None,
            help: None,
        }
    }

    /// Creates a problem with a whole file. A path at the beginning of the title is removed.
    pub fn of_file(path: &Path, title: impl Into<String>) -> Self {
        Self {
            path: Some(path.display().to_string()),
            ..Self::new(without_path(path, title))
        }
    }

    /// Creates a problem at a byte range of a text.
    pub fn at(source: &Arc<Source>, span: Range<usize>, title: impl Into<String>) -> Self {
        Self {
            source: Some(Arc::clone(source)),
            labels: vec![Label {
                span,
                text: String::new(),
            }],
            ..Self::new(title)
        }
    }

    /// Adds `text` at the place of the problem.
    #[must_use]
    pub fn label(mut self, text: impl Into<String>) -> Self {
        if let Some(label) = self.labels.first_mut() {
            label.text = text.into();
        }
        self
    }

    /// Adds a label at another place of the same text.
    #[must_use]
    pub fn also(mut self, span: Range<usize>, text: impl Into<String>) -> Self {
        self.labels.push(Label {
            span,
            text: text.into(),
        });
        self
    }

    /// Adds a remedy.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }

    /// Adds a remedy as [`Problem::help`] does, if given.
    #[must_use]
    pub fn maybe_help(mut self, text: Option<String>) -> Self {
        self.help = text.or(self.help);
        self
    }

    fn position(&self) -> (String, usize) {
        let path = self.source.as_ref().map(|source| source.path.clone());
        let start = self.labels.first().map_or(0, |label| label.span.start);
        (
            path.or_else(|| self.path.clone()).unwrap_or_default(),
            start,
        )
    }

    /// The problem in JSON form.
    fn entry(&self) -> Entry<'_> {
        let place = self.source.as_ref().zip(self.labels.first());
        let (line, column) = place
            .map(|(source, label)| line_and_column(&source.text, label.span.start))
            .unzip();
        let path = self.source.as_ref().map(|source| source.path.as_str());
        let said = self.labels.first().map(|label| label.text.as_str());
        Entry {
            file: path.or(self.path.as_deref()),
            line,
            column,
            message: &self.title,
            label: said.filter(|text| !text.is_empty()),
            help: self.help.as_deref(),
        }
    }

    fn render(&self, renderer: &Renderer) -> String {
        let mut group = Group::with_title(Level::ERROR.primary_title(self.title.as_str()));
        if let Some(source) = &self.source {
            let annotations = self.labels.iter().enumerate().map(|(index, label)| {
                let kind = if index == 0 {
                    AnnotationKind::Primary
                } else {
                    AnnotationKind::Context
                };
                let text = (!label.text.is_empty()).then_some(label.text.as_str());
                kind.span(label.span.clone()).label(text)
            });
            group = group.element(
                Snippet::source(source.text.as_str())
                    .path(source.path.as_str())
                    .annotations(annotations),
            );
        } else if let Some(path) = &self.path {
            group = group.element(Origin::path(path.as_str()));
        }
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        renderer.render(&[group])
    }
}

/// Removes the path of the file from the beginning of a message.
pub fn without_path(path: &Path, text: impl Into<String>) -> String {
    let text = text.into();
    let rest = text.strip_prefix(&format!("{}: ", path.display()));
    rest.map_or_else(|| text.clone(), str::to_owned)
}

/// A problem in JSON form.
#[derive(Debug, Serialize)]
struct Entry<'a> {
    /// Path; `None` for a problem in the arguments.
    file: Option<&'a str>,
    /// Line from 1; `None` for a problem with the whole file.
    line: Option<usize>,
    /// Column in characters, from 1.
    column: Option<usize>,
    message: &'a str,
    /// Message at the place of the problem.
    #[serde(skip_serializing_if = "Option::is_none")]
    label: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<&'a str>,
}

/// Line and column of a byte of a text, from 1.
fn line_and_column(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = before.matches('\n').count() + 1;
    (line, before[line_start..].chars().count() + 1)
}

/// Largest number of problems printed; further ones are counted.
/// Resolution: more than a user reads at once.
const MOST_SHOWN: usize = 20;

/// All problems found. Never empty if returned as an error.
#[derive(Debug, Clone, Default)]
pub struct Report {
    problems: Vec<Problem>,
}

impl Report {
    /// Adds a problem.
    pub fn push(&mut self, problem: Problem) {
        self.problems.push(problem);
    }

    /// Adds all of another report.
    pub fn append(&mut self, mut other: Self) {
        self.problems.append(&mut other.problems);
    }

    /// Removes the problems whose place is in one of these byte ranges.
    #[must_use]
    pub fn without_those_in(mut self, ranges: &[Range<usize>]) -> Self {
        self.problems.retain(|problem| {
            let at = problem.labels.first().map(|label| label.span.start);
            !at.is_some_and(|at| ranges.iter().any(|range| range.contains(&at)))
        });
        self
    }

    /// Number of problems.
    pub fn len(&self) -> usize {
        self.problems.len()
    }

    /// Whether there are no problems.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Returns `Ok(value)` if there are no problems.
    ///
    /// # Errors
    /// The report with its problems in the order of their places, if there are any.
    pub fn into_result<T>(mut self, value: T) -> Result<T, Self> {
        if self.is_empty() {
            return Ok(value);
        }
        self.problems.sort_by_cached_key(Problem::position);
        Err(self)
    }

    /// All problems as JSON: `{"errors": [{"file", "line", "column", "message", "label", "help"}]}`.
    pub fn json(&self) -> serde_json::Value {
        let errors: Vec<Entry<'_>> = self.problems.iter().map(Problem::entry).collect();
        serde_json::json!({ "errors": errors })
    }

    /// Formats all problems and their number as rustc does, with colours if `styled`.
    pub fn render(&self, styled: bool) -> String {
        let renderer = if styled {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        let mut text = String::new();
        for problem in self.problems.iter().take(MOST_SHOWN) {
            text += &problem.render(&renderer);
            text += "\n\n";
        }
        let count = self.problems.len();
        let plural = if count == 1 { "" } else { "s" };
        if count > MOST_SHOWN {
            text += &format!("and {} more\n\n", count - MOST_SHOWN);
        }
        text + &format!("{count} error{plural}; nothing was started")
    }
}

impl From<Problem> for Report {
    fn from(problem: Problem) -> Self {
        Self {
            problems: vec![problem],
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let texts: Vec<String> = self
            .problems
            .iter()
            .take(MOST_SHOWN)
            .map(|problem| problem.render(&Renderer::plain()))
            .collect();
        f.write_str(&texts.join("\n\n"))
    }
}

impl std::error::Error for Report {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_reads_file_line_and_column() {
        let source = Source::new(Path::new("p.yaml"), "a: 1\nä: {b: x}\n".to_owned());
        let mut report = Report::default();
        report.push(Problem::at(&source, 13..14, "`x` is no number").help("give one"));
        report.push(Problem::of_file(Path::new("q.yaml"), "q.yaml: is empty"));
        let json = report.json();
        let first = &json["errors"][0];
        assert_eq!(
            (&first["line"], &first["column"]),
            (&2.into(), &8.into()),
            "{json}"
        );
        assert_eq!(first["file"], "p.yaml");
        assert_eq!(first["help"], "give one");
        assert_eq!(json["errors"][1]["file"], "q.yaml");
        assert_eq!(json["errors"][1]["message"], "is empty");
        assert_eq!(json["errors"][1]["line"], serde_json::Value::Null);
    }
}
