//! "Did you mean": the known word nearest to an unknown one.

/// Smallest similarity (Jaro-Winkler, 0 to 1) of a suggested word.
/// Derived: a word of five letters keeps at least 0.87 with one wrong letter, and at most 0.81 with two.
pub const LEAST_SIMILARITY: f64 = 0.85;

/// Returns the known word that `word` was probably meant to be.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|candidate| (strsim::jaro_winkler(word, candidate), candidate))
        .filter(|(similarity, _)| *similarity >= LEAST_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// Returns a help line: the nearest word if there is one, else all of them if they are few enough to read.
pub fn help<'a>(
    word: &str,
    what: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    /// Largest number of known words that are listed.
    /// Layout: by eye; no number depends on it.
    const MOST_LISTED: usize = 16;
    let known: Vec<&str> = known.into_iter().collect();
    if let Some(candidate) = nearest(word, known.iter().copied()) {
        return Some(format!("did you mean `{candidate}`?"));
    }
    (1..=MOST_LISTED)
        .contains(&known.len())
        .then(|| format!("{what}: {}", list(known.iter().copied())))
}

/// Formats words as `` `a`, `b`, `c` ``.
pub fn list<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = words.into_iter().map(|word| format!("`{word}`")).collect();
    quoted.join(", ")
}

/// Formats the first few of many words.
pub fn some(words: &[&str]) -> String {
    /// Largest number of named words.
    /// Layout: by eye; no number depends on it.
    const MOST_NAMED: usize = 8;
    let first = words[..words.len().min(MOST_NAMED)].join(", ");
    match words.len().saturating_sub(MOST_NAMED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// Returns ` on /joint_states`, or nothing.
pub(crate) fn on(topic: Option<&str>) -> String {
    topic.map_or_else(String::new, |topic| format!(" on {topic}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typo_finds_its_word_and_nonsense_finds_none() {
        let known = ["record", "replay", "ingest"];
        assert_eq!(nearest("recrod", known), Some("record"));
        assert_eq!(nearest("xyz", known), None);
        assert_eq!(
            help("xyz", "known are", known),
            Some("known are: `record`, `replay`, `ingest`".to_owned())
        );
    }
}
