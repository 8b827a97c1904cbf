//! Places in a file, as paths of keys and indices, and their byte ranges.

use std::collections::HashMap;
use std::fmt::Write;
use std::ops::Range;

/// Path from the root of a file to a value, as a JSON pointer.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Place(String);

impl Place {
    /// The root of the file.
    pub fn root() -> Self {
        Self::default()
    }

    /// The value under `key` of the mapping at this place.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        Self(format!(
            "{}/{}",
            self.0,
            key.replace('~', "~0").replace('/', "~1")
        ))
    }

    /// Item `index` of the sequence at this place.
    #[must_use]
    pub fn index(&self, index: usize) -> Self {
        Self(format!("{}/{index}", self.0))
    }

    /// Creates a place from a JSON pointer.
    pub(super) fn from_pointer(pointer: &str) -> Self {
        Self(pointer.to_owned())
    }

    /// Creates a place from the path of a deserialisation error.
    pub(super) fn from_serde(path: &serde_path_to_error::Path) -> Self {
        use serde_path_to_error::Segment;
        path.iter()
            .fold(Self::root(), |place, segment| match segment {
                Segment::Seq { index } => place.index(*index),
                Segment::Map { key } => place.key(key),
                Segment::Enum { .. } | Segment::Unknown => place,
            })
    }

    /// The top-level entry that contains this place: `/stages/2`, `/cells/demo`.
    pub(super) fn entry(&self) -> Self {
        let ends = self.0.match_indices('/').map(|(at, _)| at);
        let end = ends.skip(1).nth(1).unwrap_or(self.0.len());
        Self(self.0[..end].to_owned())
    }

    fn parent(&self) -> Option<Self> {
        self.0.rfind('/').map(|at| Self(self.0[..at].to_owned()))
    }

    /// Readable form: `stages[2].input`; empty for the root.
    pub fn describe(&self) -> String {
        let mut text = String::new();
        for segment in self.0.split('/').skip(1) {
            if segment.bytes().all(|b| b.is_ascii_digit()) && !segment.is_empty() {
                let _ = write!(text, "[{segment}]");
            } else {
                let separator = if text.is_empty() { "" } else { "." };
                let _ = write!(
                    text,
                    "{separator}{}",
                    segment.replace("~1", "/").replace("~0", "~")
                );
            }
        }
        text
    }
}

#[derive(Debug)]
struct Entry {
    key: Option<Range<usize>>,
    value: Range<usize>,
}

/// Ranges of all places in a text \[bytes\].
#[derive(Debug, Default)]
pub struct Spans {
    entries: HashMap<Place, Entry>,
}

impl Spans {
    pub(super) fn insert(&mut self, place: Place, key: Option<Range<usize>>, value: Range<usize>) {
        self.entries.insert(place, Entry { key, value });
    }

    /// Range of the value at `place`, or at the nearest enclosing place.
    pub fn value(&self, place: &Place) -> Range<usize> {
        self.nearest(place)
            .map_or(0..0, |entry| entry.value.clone())
    }

    /// Range of the key at `place`; of the value if it has no key.
    pub fn key(&self, place: &Place) -> Range<usize> {
        self.nearest(place).map_or(0..0, |entry| {
            entry.key.clone().unwrap_or_else(|| entry.value.clone())
        })
    }

    fn nearest(&self, place: &Place) -> Option<&Entry> {
        let mut place = place.clone();
        loop {
            if let Some(entry) = self.entries.get(&place) {
                return Some(entry);
            }
            place = place.parent()?;
        }
    }
}
