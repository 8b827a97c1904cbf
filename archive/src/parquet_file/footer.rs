//! The footer: the columns of a file, and the positions of their pages.

use super::error::ParquetProblem;
use super::thrift::{Broken, Field, Reader};

/// Maximum number of row groups of a file.
/// Resolution: bounds memory; LeRobot writes one for each episode.
const MAX_GROUPS: usize = 1 << 20;
/// Maximum number of rows of a file.
/// Resolution: bounds time; an episode at 1 kHz has this number after four hours.
const MAX_ROWS: u64 = 1 << 24;
/// Maximum number of columns in an error message.
/// Layout: by eye; no number depends on it.
const MOST_NAMES: usize = 40;

/// Storage type of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Physical {
    Int32,
    Int64,
    Float,
    Double,
}

impl Physical {
    /// Returns the size of a number \[bytes\].
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Int32 | Self::Float => 4,
            Self::Int64 | Self::Double => 8,
        }
    }

    /// Decodes a number. Returns `None` if `bytes` has another size.
    pub(super) fn number(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::Int32 => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            Self::Int64 => i64::from_le_bytes(bytes.try_into().ok()?) as f64,
            Self::Float => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            Self::Double => f64::from_le_bytes(bytes.try_into().ok()?),
        })
    }
}

/// Compression of the pages of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    None,
    Snappy,
    Zstd,
    /// An unsupported codec, by its number.
    Other(i64),
}

/// A selected column: numbers, or lists of numbers.
#[derive(Debug)]
pub(super) struct Leaf {
    pub(super) name: String,
    pub(super) physical: Physical,
    /// Its index among all columns of the file.
    place: usize,
    /// Definition level of a number that is not null.
    pub(super) defined: u32,
    /// In a list, lowest definition level of an element; 0 if it is not a list.
    pub(super) element: u32,
    /// Whether it is a list.
    pub(super) is_list: bool,
}

/// A row group.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) rows: u64,
    /// The pages of each selected column.
    pub(super) chunks: Vec<Chunk>,
}

/// The pages of one column in a group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chunk {
    pub(super) codec: Codec,
    /// Their offset in the file \[bytes\].
    pub(super) start: u64,
    /// Their length \[bytes\].
    pub(super) bytes: u64,
}

/// Contents of the footer.
#[derive(Debug)]
pub(super) struct Footer {
    /// Columns of the outermost level, at most [`MOST_NAMES`].
    pub(super) names: Vec<String>,
    /// The selected columns that exist.
    pub(super) leaves: Vec<Leaf>,
    pub(super) groups: Vec<Group>,
}

impl Footer {
    /// Parses the footer `text` of a file of `file_bytes`, for the columns `wanted`.
    pub(super) fn parse(
        text: &[u8],
        wanted: &[&str],
        file_bytes: u64,
    ) -> Result<Self, ParquetProblem> {
        let mut schema = Schema::new(wanted);
        let mut groups: Vec<Group> = Vec::new();
        let parsed = Reader::new(text).fields(|reader, field| match field.id {
            2 => reader.structs(field, |reader| {
                let node = Node::parse(reader)?;
                schema.add(node)
            }),
            // The schema comes before the row groups.
            4 => reader.structs(field, |reader| {
                if groups.len() >= MAX_GROUPS {
                    return Err(Broken);
                }
                groups.push(group(reader, &schema.leaves, file_bytes)?);
                Ok(())
            }),
            _ => reader.skip(field),
        });
        parsed.map_err(|Broken| ParquetProblem::Footer("it is not as the format says"))?;
        if let Some((column, what)) = schema.refused {
            return Err(ParquetProblem::Unsupported { column, what });
        }
        if schema.names.is_empty() {
            return Err(ParquetProblem::Footer("it names no columns"));
        }
        let rows = groups
            .iter()
            .fold(0_u64, |sum, group| sum.saturating_add(group.rows));
        if rows > MAX_ROWS {
            return Err(ParquetProblem::Footer(
                "it declares more than 16 million rows",
            ));
        }
        Ok(Self {
            names: schema.names,
            leaves: schema.leaves,
            groups,
        })
    }
}

/// A node of the schema.
struct Node {
    name: String,
    physical: Option<i64>,
    /// 0 required, 1 optional, 2 repeated.
    repetition: i64,
    children: u64,
}

impl Node {
    fn parse(reader: &mut Reader<'_>) -> Result<Self, Broken> {
        let mut node = Self {
            name: String::new(),
            physical: None,
            repetition: 0,
            children: 0,
        };
        reader.fields(|reader, field| {
            match field.id {
                1 => node.physical = Some(reader.integer(field)?),
                3 => node.repetition = reader.integer(field)?,
                4 => node.name = String::from_utf8_lossy(reader.text(field)?).into_owned(),
                5 => node.children = u64::try_from(reader.integer(field)?).map_err(|_| Broken)?,
                _ => reader.skip(field)?,
            }
            Ok(())
        })?;
        Ok(node)
    }
}

/// A group of the schema whose children are being read.
#[derive(Clone, Copy)]
struct Open {
    children_left: u64,
    defined: u32,
    repeated: u32,
    element: u32,
}

/// The schema, built from its nodes in depth-first order.
struct Schema<'a> {
    wanted: &'a [&'a str],
    open: Vec<Open>,
    /// The column of the outermost level to which the next node belongs, if it is selected.
    top: Option<String>,
    leaves_seen: usize,
    names: Vec<String>,
    leaves: Vec<Leaf>,
    refused: Option<(String, String)>,
}

impl<'a> Schema<'a> {
    fn new(wanted: &'a [&'a str]) -> Self {
        Self {
            wanted,
            open: Vec::new(),
            top: None,
            leaves_seen: 0,
            names: Vec::new(),
            leaves: Vec::new(),
            refused: None,
        }
    }

    fn add(&mut self, node: Node) -> Result<(), Broken> {
        while self.open.last().is_some_and(|open| open.children_left == 0) {
            self.open.pop();
        }
        let Some(parent) = self.open.last_mut() else {
            // The root, which is no column.
            if self.leaves_seen > 0 {
                return Err(Broken);
            }
            self.open.push(Open {
                children_left: node.children,
                defined: 0,
                repeated: 0,
                element: 0,
            });
            return Ok(());
        };
        parent.children_left -= 1;
        let mut open = Open {
            children_left: node.children,
            ..*parent
        };
        open.defined += u32::from(node.repetition != 0);
        if node.repetition == 2 {
            open.repeated += 1;
            open.element = open.defined;
        }
        if self.open.len() == 1 {
            self.top = self
                .wanted
                .contains(&node.name.as_str())
                .then(|| node.name.clone());
            if self.names.len() < MOST_NAMES {
                self.names.push(node.name);
            }
        }
        if node.children == 0 {
            self.leaf(node.physical, open);
        } else if self.open.len() > 32 {
            return Err(Broken);
        } else {
            self.open.push(open);
        }
        Ok(())
    }

    fn leaf(&mut self, physical: Option<i64>, open: Open) {
        let place = self.leaves_seen;
        self.leaves_seen += 1;
        let Some(name) = self.top.clone() else { return };
        let physical = match physical {
            Some(1) => Ok(Physical::Int32),
            Some(2) => Ok(Physical::Int64),
            Some(4) => Ok(Physical::Float),
            Some(5) => Ok(Physical::Double),
            Some(0) => Err("a column of truth values"),
            _ => Err("a column of no numbers"),
        };
        let nested = open.repeated > 1 || self.leaves.iter().any(|leaf| leaf.name == name);
        match physical {
            Ok(physical) if !nested => self.leaves.push(Leaf {
                name,
                physical,
                place,
                defined: open.defined,
                element: open.element,
                is_list: open.repeated == 1,
            }),
            Ok(_) => self.refuse(name, "a nested column"),
            Err(what) => self.refuse(name, what),
        }
    }

    fn refuse(&mut self, column: String, what: &str) {
        self.refused.get_or_insert((column, what.to_owned()));
    }
}

fn group(reader: &mut Reader<'_>, leaves: &[Leaf], file_bytes: u64) -> Result<Group, Broken> {
    let mut chunks: Vec<Option<Chunk>> = vec![None; leaves.len()];
    let mut rows = None;
    reader.fields(|reader, field| {
        match field.id {
            1 => {
                let mut place = 0;
                reader.structs(field, |reader| {
                    let own = leaves.iter().position(|leaf| leaf.place == place);
                    place += 1;
                    let chunk = chunk(reader, file_bytes, own.is_some())?;
                    if let Some(own) = own {
                        chunks[own] = chunk;
                    }
                    Ok(())
                })?;
            }
            3 => rows = Some(reader.integer(field)?),
            _ => reader.skip(field)?,
        }
        Ok(())
    })?;
    let rows = rows.and_then(|rows| u64::try_from(rows).ok());
    Ok(Group {
        rows: rows.ok_or(Broken)?,
        chunks: chunks.into_iter().collect::<Option<_>>().ok_or(Broken)?,
    })
}

/// Parses the position of the pages of a column. Returns `None` if the column is not selected.
fn chunk(
    reader: &mut Reader<'_>,
    file_bytes: u64,
    is_wanted: bool,
) -> Result<Option<Chunk>, Broken> {
    let mut found = None;
    let mut metadata = |reader: &mut Reader<'_>, field: Field| {
        Reader::is_struct(field)?;
        let (mut codec, mut bytes, mut data, mut dictionary) = (0, 0, 0, None);
        reader.fields(|reader, field| {
            match field.id {
                4 => codec = reader.integer(field)?,
                7 => bytes = reader.integer(field)?,
                9 => data = reader.integer(field)?,
                11 => dictionary = Some(reader.integer(field)?),
                _ => reader.skip(field)?,
            }
            Ok(())
        })?;
        // Some writers write 0 if there is no dictionary.
        let start = dictionary
            .filter(|at| (1..data).contains(at))
            .unwrap_or(data);
        let start = u64::try_from(start).map_err(|_| Broken)?;
        let bytes = u64::try_from(bytes).map_err(|_| Broken)?;
        if start.checked_add(bytes).is_none_or(|end| end > file_bytes) {
            return Err(Broken);
        }
        found = Some(Chunk {
            codec: match codec {
                0 => Codec::None,
                1 => Codec::Snappy,
                6 => Codec::Zstd,
                other => Codec::Other(other),
            },
            start,
            bytes,
        });
        Ok(())
    };
    reader.fields(|reader, field| match field.id {
        // The pages are in another file.
        1 if is_wanted => Err(Broken),
        3 if is_wanted => metadata(reader, field),
        _ => reader.skip(field),
    })?;
    Ok(found)
}
