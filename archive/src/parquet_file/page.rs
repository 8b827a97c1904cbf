//! Pages of a column: parsing of headers, decompression, and access to the entries.

use std::io::Read as _;

use super::error::ParquetProblem;
use super::footer::{Chunk, Codec, Leaf};
use super::hybrid::Hybrid;
use super::thrift::{Broken, Reader};
use super::{MAGIC, ParquetFile};

/// Maximum size of a page, decompressed \[bytes\].
/// Resolution: bounds memory; writers begin a new page after 1 MiB.
const MAX_PAGE_BYTES: u64 = 32 << 20;
/// Number of bytes first read for the header of a page; sufficient unless it has long statistics.
const HEADER_BYTES: u64 = 512;
/// Maximum size of the header of a page \[bytes\].
/// Resolution: bounds memory.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Numbers of the supported encodings in the Parquet format.
const PLAIN: i64 = 0;
const PLAIN_DICTIONARY: i64 = 2;
const RLE_DICTIONARY: i64 = 8;

/// Numbers of the kinds of pages in the Parquet format.
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;
const DATA_2: i64 = 3;

/// Fields of a page header; -1 for an absent field.
struct Header {
    kind: i64,
    unpacked: i64,
    packed: i64,
    crc: Option<i64>,
    values: i64,
    encoding: i64,
    /// Lengths of the definition and repetition levels, in pages of version 2 \[bytes\].
    definition: i64,
    repetition: i64,
    is_packed: bool,
}

/// A page of a column.
pub(super) enum Page {
    /// Numbers to which later pages refer by index.
    Dictionary(Vec<u8>),
    /// Numbers.
    Data(DataPage),
    /// A page of another kind.
    Other,
}

/// Numbers with their levels, and the position of the next entry.
#[derive(Debug, Default)]
pub(super) struct DataPage {
    bytes: Vec<u8>,
    /// Number of entries not read yet.
    pub(super) left: u64,
    repetition: Option<Hybrid>,
    definition: Option<Hybrid>,
    values: Values,
}

/// Location of the numbers of a page.
#[derive(Debug)]
enum Values {
    /// In the page, from this offset on.
    Plain(usize),
    /// In the dictionary, at these indices.
    Dictionary(Hybrid),
}

impl Default for Values {
    fn default() -> Self {
        Self::Plain(0)
    }
}

/// One entry of a column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// Whether it is the first of its row.
    pub(super) begins_row: bool,
    /// Its number: NaN for a null value, `None` for an empty list.
    pub(super) value: Option<f64>,
}

impl DataPage {
    /// Returns the next entry; `None` if the page ends before it.
    pub(super) fn entry(&mut self, leaf: &Leaf, dictionary: &[u8]) -> Option<Entry> {
        self.left = self.left.checked_sub(1)?;
        let page = &self.bytes;
        let level = |levels: &mut Option<Hybrid>, otherwise| match levels {
            Some(levels) => levels.next(page),
            None => Some(otherwise),
        };
        let repetition = level(&mut self.repetition, 0)?;
        let definition = level(&mut self.definition, leaf.defined)?;
        let value = if definition < leaf.defined {
            (definition >= leaf.element).then_some(f64::NAN)
        } else {
            let bytes = leaf.physical.bytes();
            let (from, at) = match &mut self.values {
                Values::Plain(at) => {
                    let own = *at;
                    *at += bytes;
                    (page.as_slice(), own)
                }
                Values::Dictionary(places) => (dictionary, places.next(page)? as usize * bytes),
            };
            Some(
                leaf.physical
                    .number(from.get(at..at.checked_add(bytes)?)?)?,
            )
        };
        Some(Entry {
            begins_row: repetition == 0,
            value,
        })
    }
}

/// Reads the page at `at` of `chunk`. Returns it with the offset of the next page.
pub(super) fn read(
    file: &ParquetFile,
    leaf: &Leaf,
    chunk: &Chunk,
    at: u64,
) -> Result<(Page, u64), PageProblem> {
    let end = chunk.start + chunk.bytes;
    let (header, header_bytes) = header(file, at, end)?;
    let size = |bytes: i64| u64::try_from(bytes).map_err(|_| PageProblem::Damaged(SIZES));
    let (packed, unpacked) = (size(header.packed)?, size(header.unpacked)?);
    let start = at + header_bytes;
    let next = start.checked_add(packed).filter(|next| *next <= end);
    let next = next.ok_or(PageProblem::Damaged(SIZES))?;
    if ![DATA, DATA_2, DICTIONARY].contains(&header.kind) {
        return Ok((Page::Other, next));
    }
    for bytes in [packed, unpacked] {
        if bytes > MAX_PAGE_BYTES {
            return Err(PageProblem::Refused(ParquetProblem::TooLarge {
                what: "a page",
                bytes,
                limit: MAX_PAGE_BYTES,
            }));
        }
    }
    let mut bytes = vec![0; packed as usize];
    file.read(&mut bytes, start).map_err(PageProblem::Refused)?;
    if header
        .crc
        .is_some_and(|crc| crc as u32 != crc32fast::hash(&bytes))
    {
        return Err(PageProblem::Damaged("a checksum is wrong"));
    }
    // In version 2, the levels precede the compressed part.
    let levels = if header.kind == DATA_2 {
        size(header.definition)?.saturating_add(size(header.repetition)?)
    } else {
        0
    };
    if levels > packed.min(unpacked) {
        return Err(PageProblem::Damaged(SIZES));
    }
    if header.is_packed {
        bytes = unpack(
            leaf,
            chunk.codec,
            &bytes,
            levels as usize,
            unpacked as usize,
        )?;
    }
    if bytes.len() as u64 != unpacked {
        return Err(PageProblem::Damaged(
            "a page has another length than it says",
        ));
    }
    let page = if header.kind == DICTIONARY {
        plain_dictionary(leaf, &header)?;
        Page::Dictionary(bytes)
    } else {
        Page::Data(data(leaf, &header, bytes)?)
    };
    Ok((page, next))
}

const SIZES: &str = "a page declares sizes that do not fit";

/// Reason why a page cannot be read.
pub(super) enum PageProblem {
    /// A malformed page.
    Damaged(&'static str),
    /// An unsupported page, or an I/O error.
    Refused(ParquetProblem),
}

impl From<Broken> for PageProblem {
    fn from(Broken: Broken) -> Self {
        Self::Damaged("the header of a page makes no sense")
    }
}

/// Reads the header at `at`. Returns it with its length.
fn header(file: &ParquetFile, at: u64, end: u64) -> Result<(Header, u64), PageProblem> {
    // At least the final magic of the file follows a column.
    let room = (file.bytes - MAGIC.len() as u64)
        .min(end)
        .saturating_sub(at);
    for most in [HEADER_BYTES, MAX_HEADER_BYTES] {
        let mut text = vec![0; room.min(most) as usize];
        file.read(&mut text, at).map_err(PageProblem::Refused)?;
        let mut reader = Reader::new(&text);
        match parse(&mut reader) {
            Ok(header) => return Ok((header, reader.at as u64)),
            Err(Broken) if room > most => {}
            Err(broken) => return Err(broken.into()),
        }
    }
    Err(Broken.into())
}

fn parse(reader: &mut Reader<'_>) -> Result<Header, Broken> {
    let mut header = Header {
        kind: -1,
        unpacked: -1,
        packed: -1,
        crc: None,
        values: -1,
        encoding: -1,
        definition: -1,
        repetition: -1,
        is_packed: true,
    };
    reader.fields(|reader, field| {
        match field.id {
            1 => header.kind = reader.integer(field)?,
            2 => header.unpacked = reader.integer(field)?,
            3 => header.packed = reader.integer(field)?,
            4 => header.crc = Some(reader.integer(field)?),
            // Headers of a page of version 1, of a dictionary and of a page of version 2.
            version @ (5 | 7 | 8) => {
                Reader::is_struct(field)?;
                reader.fields(|reader, field| {
                    match (version, field.id) {
                        (_, 1) => header.values = reader.integer(field)?,
                        (5 | 7, 2) | (8, 4) => header.encoding = reader.integer(field)?,
                        (8, 5) => header.definition = reader.integer(field)?,
                        (8, 6) => header.repetition = reader.integer(field)?,
                        (8, 7) => header.is_packed = Reader::boolean(field)?,
                        _ => reader.skip(field)?,
                    }
                    Ok(())
                })?;
            }
            _ => reader.skip(field)?,
        }
        Ok(())
    })?;
    Ok(header)
}

/// Decompresses the part after the first `levels` bytes. The whole page should have `unpacked` bytes, which bounds
/// the memory.
fn unpack(
    leaf: &Leaf,
    codec: Codec,
    bytes: &[u8],
    levels: usize,
    unpacked: usize,
) -> Result<Vec<u8>, PageProblem> {
    const BROKEN: PageProblem = PageProblem::Damaged("a page cannot be unpacked");
    let (levels, packed) = bytes.split_at(levels);
    let mut all = Vec::with_capacity(unpacked);
    all.extend_from_slice(levels);
    match codec {
        Codec::None => all.extend_from_slice(packed),
        // A page of null values only has nothing to decompress.
        _ if unpacked == levels.len() => {}
        Codec::Snappy => {
            all.resize(unpacked, 0);
            let room = &mut all[levels.len()..];
            let length = snap::raw::Decoder::new().decompress(packed, room);
            if length.map_err(|_| BROKEN)? != room.len() {
                return Err(BROKEN);
            }
        }
        Codec::Zstd => {
            let decoder = zstd::stream::read::Decoder::new(packed).map_err(|_| BROKEN)?;
            let most = unpacked as u64 + 1;
            decoder
                .take(most)
                .read_to_end(&mut all)
                .map_err(|_| BROKEN)?;
        }
        Codec::Other(number) => {
            let name = match number {
                2 => "Gzip",
                3 => "LZO",
                4 => "Brotli",
                5 | 7 => "LZ4",
                _ => "something new",
            };
            return Err(refused(leaf, &format!("compressed with {name}")));
        }
    }
    Ok(all)
}

fn refused(leaf: &Leaf, what: &str) -> PageProblem {
    PageProblem::Refused(ParquetProblem::Unsupported {
        column: leaf.name.clone(),
        what: what.to_owned(),
    })
}

fn plain_dictionary(leaf: &Leaf, header: &Header) -> Result<(), PageProblem> {
    match header.encoding {
        PLAIN | PLAIN_DICTIONARY => Ok(()),
        _ => Err(refused(leaf, "encoded in an unusual dictionary")),
    }
}

/// Locates the levels and the numbers in a decompressed page.
fn data(leaf: &Leaf, header: &Header, bytes: Vec<u8>) -> Result<DataPage, PageProblem> {
    let left = u64::try_from(header.values).map_err(|_| PageProblem::Damaged(SIZES))?;
    let (repeats, defines) = (leaf.is_list, leaf.defined > 0);
    let width = |most: u32| u32::BITS - most.leading_zeros();
    let mut at = 0;
    let mut levels = |is_there: bool, most: u32, length: i64| {
        if header.kind == DATA && !is_there {
            return Ok(None);
        }
        let length = if header.kind == DATA {
            let head = bytes.get(at..at + 4).and_then(|head| head.try_into().ok());
            at += 4;
            head.map(u32::from_le_bytes).map(|length| length as usize)
        } else {
            usize::try_from(length).ok()
        };
        let end = length.and_then(|length| at.checked_add(length));
        let end = end.filter(|end| *end <= bytes.len());
        let end = end.ok_or(PageProblem::Damaged(SIZES))?;
        let levels = Hybrid::new(at, end, width(most));
        at = end;
        Ok::<_, PageProblem>(is_there.then_some(levels))
    };
    let repetition = levels(repeats, 1, header.repetition)?;
    let definition = levels(defines, leaf.defined, header.definition)?;
    let values = match header.encoding {
        PLAIN => Values::Plain(at),
        PLAIN_DICTIONARY | RLE_DICTIONARY => {
            // A page of null values only may have no dictionary indices, and no bit width for them.
            let width = bytes.get(at).copied().unwrap_or(0);
            if width > 32 {
                return Err(PageProblem::Damaged(
                    "a place in a dictionary makes no sense",
                ));
            }
            Values::Dictionary(Hybrid::new(at + 1, bytes.len(), u32::from(width)))
        }
        other => {
            let name = match other {
                5 => "encoded as DELTA_BINARY_PACKED",
                9 => "encoded as BYTE_STREAM_SPLIT",
                _ => "encoded in an unusual way",
            };
            return Err(refused(leaf, name));
        }
    };
    Ok(DataPage {
        bytes,
        left,
        repetition,
        definition,
        values,
    })
}
