//! Why a source gives nothing that can be used: what it waits for, what is there instead, and the likeliest slip.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Lines of a list that are kept; the rest is only counted.
const MAX_LINES: usize = 12;
/// Longer lines are cut.
const MAX_CHARS: usize = 400;

/// Why a source gives nothing that can be used, for people. Bounded, whatever goes into it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Trouble {
    /// What is wrong, in a sentence without figures that change: who has read it once need not read it again.
    pub what: String,
    /// What is waited for, a line each.
    pub expected: Vec<String>,
    /// What is there instead, a line each.
    pub seen: Vec<String>,
    /// The likeliest slip, and its remedy.
    pub likely: Option<String>,
}

impl Trouble {
    /// What is wrong.
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: cut(what.into()),
            ..Self::default()
        }
    }

    /// Adds what is waited for.
    #[must_use]
    pub fn expects(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        add(&mut self.expected, lines);
        self
    }

    /// Adds what is there instead.
    #[must_use]
    pub fn sees(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        add(&mut self.seen, lines);
        self
    }

    /// Says what the slip probably is, unless that is said already.
    #[must_use]
    pub fn likely(mut self, slip: Option<String>) -> Self {
        self.likely = self.likely.or(slip.map(cut));
        self
    }

    /// Whether both say the same is wrong; what is seen may differ by the hour.
    pub fn is_like(&self, other: &Self) -> bool {
        self.what == other.what && self.likely == other.likely
    }
}

/// What is wrong, then a line each for what is waited for, what is there, and the slip.
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
