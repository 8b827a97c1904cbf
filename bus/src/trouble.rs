//! Diagnosis of a source without usable data: expected data, data seen instead, and the most likely mistake.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Largest number of lines in a list; further lines are only counted.
const MAX_LINES: usize = 12;
/// Longest line \[characters\]; longer lines are cut.
const MAX_CHARS: usize = 400;

/// Diagnosis of a source without usable data, for people. Its size is bounded for any input.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Trouble {
    /// Problem in one sentence, without varying numbers, so that a repeated report reads the same.
    pub what: String,
    /// Expected data, one line each.
    pub expected: Vec<String>,
    /// Data seen instead, one line each.
    pub seen: Vec<String>,
    /// Most likely mistake, and its remedy.
    pub likely: Option<String>,
}

impl Trouble {
    /// A diagnosis of the problem `what`.
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: cut(what.into()),
            ..Self::default()
        }
    }

    /// Adds expected data.
    #[must_use]
    pub fn expects(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        add(&mut self.expected, lines);
        self
    }

    /// Adds data seen instead.
    #[must_use]
    pub fn sees(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        add(&mut self.seen, lines);
        self
    }

    /// Sets the most likely mistake, unless it is set already.
    #[must_use]
    pub fn likely(mut self, slip: Option<String>) -> Self {
        self.likely = self.likely.or(slip.map(cut));
        self
    }

    /// Whether both report the same problem, whatever data was seen.
    pub fn is_like(&self, other: &Self) -> bool {
        self.what == other.what && self.likely == other.likely
    }
}

/// The problem, then one line each for expected data, data seen and the likely mistake.
impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        for line in &self.expected {
            write!(f, "\n  expected: {line}")?;
        }
        for line in &self.seen {
            write!(f, "\n  seen: {line}")?;
        }
        if let Some(likely) = &self.likely {
            write!(f, "\n  likely: {likely}")?;
        }
        Ok(())
    }
}

fn add(to: &mut Vec<String>, lines: impl IntoIterator<Item = String>) {
    let mut more = 0_usize;
    for line in lines {
        if to.len() < MAX_LINES {
            to.push(cut(line));
        } else {
            more += 1;
        }
    }
    if more > 0 {
        to.push(format!("and {more} more"));
    }
}

fn cut(mut line: String) -> String {
    if let Some((end, _)) = line.char_indices().nth(MAX_CHARS) {
        line.truncate(end);
        line.push_str("...");
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stays_small_whatever_is_seen() {
        let keys = (0..1000).map(|n| format!("{n}{}", "x".repeat(1000)));
        let trouble = Trouble::new("nothing comes").sees(keys);
        assert_eq!(trouble.seen.len(), MAX_LINES + 1);
        assert_eq!(trouble.seen[MAX_LINES], "and 988 more");
        assert!(trouble.seen.iter().all(|line| line.len() <= MAX_CHARS + 3));
    }

    #[test]
    fn it_reads_as_a_sentence_and_a_line_for_each_fact() {
        let trouble = Trouble::new("nothing comes")
            .expects(["a/b".to_owned()])
            .sees(["a/c (3 messages)".to_owned()])
            .likely(Some("the topic is c".to_owned()));
        let text =
            "nothing comes\n  expected: a/b\n  seen: a/c (3 messages)\n  likely: the topic is c";
        assert_eq!(trouble.to_string(), text);
        let later = trouble.clone().sees(["a/d".to_owned()]);
        assert!(trouble.is_like(&later));
    }
}
