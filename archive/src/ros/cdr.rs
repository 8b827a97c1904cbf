//! Bytes of messages: OMG CDR (XCDR1) behind its four-byte encapsulation header, as every ROS 2
//! middleware writes them. The header is `00 00` (big endian) or `00 01` (little endian) and two
//! bytes of options; alignment counts from the byte after it (DDSI-RTPS 2.3, section 10.2).

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::CdrDeserializer;

use super::Message;

const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];
/// Middlewares pad a payload to four or eight bytes.
/// Physical: one byte less than the largest alignment.
pub(super) const MAX_PADDING: usize = 7;

/// An error of decoding a message.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Fewer bytes than an encapsulation header.
    #[error("{len} bytes are too short for a CDR message")]
    TooShort {
        /// Number of bytes.
        len: usize,
    },
    /// An encoding other than plain CDR.
    #[error("{}", of_encapsulation(*id))]
    Encapsulation {
        /// The first two bytes.
        id: [u8; 2],
    },
    /// Bytes that do not hold the fields of the type.
    #[error("byte {at} of {len}: {source}")]
    Fields {
        /// Offset at which reading stopped.
        at: usize,
        /// Number of bytes.
        len: usize,
        /// The CDR error.
        source: cdr_encoding::Error,
    },
    /// More bytes than the fields of the type.
    #[error("{extra} bytes are left over after {type_name}")]
    LeftOver {
        /// Number of excess bytes.
        extra: usize,
        /// The type that was read.
        type_name: &'static str,
    },
    /// A stamp before 1970, or with a second or more of nanoseconds.
    #[error("stamp {sec} s {nanosec} ns is not a time since the epoch")]
    Stamp {
        /// Seconds.
        sec: i32,
        /// Nanoseconds.
        nanosec: u32,
    },
    /// An array whose length differs from the number of names.
    #[error(
        "`{array}` has {} for {} ({}): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again",
        counted(*len, ENTRY),
        counted(*names, NAME),
        listed(first_names, *names)
    )]
    ArrayLength {
        /// Name of the array.
        array: &'static str,
        /// Number of its entries.
        len: usize,
        /// Number of names.
        names: usize,
        /// The first few names.
        first_names: Vec<String>,
    },
    /// Values without names.
    #[error("`name` is empty, but `{array}` has {}: their joints are unknown", counted(*len, ENTRY))]
    NoNames {
        /// Name of the array.
        array: &'static str,
        /// Number of its entries.
        len: usize,
    },
    /// A compressed message that cannot be decompressed.
    #[error(
        "the message is compressed with Zstandard and cannot be decompressed ({reason}): \
         record without message compression"
    )]
    Compressed {
        /// Reason.
        reason: &'static str,
    },
    /// A body that is not a ROS 1 message of its type.
    #[error("the {len} bytes are not a {type_name} in the encoding of ROS 1")]
    Ros1 {
        /// Number of bytes.
        len: usize,
        /// Type of the topic.
        type_name: &'static str,
    },
}

/// Singular and plural.
const ENTRY: [&str; 2] = ["entry", "entries"];
const NAME: [&str; 2] = ["name", "names"];

fn counted(count: usize, [one, many]: [&str; 2]) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Maximum number of names in an error message.
/// Resolution: what a person reads.
const MOST_NAMED: usize = 8;

impl DecodeError {
    /// Returns the error for an array of `len` entries that does not match `names`.
    pub(super) fn array_length(array: &'static str, len: usize, names: &[String]) -> Self {
        Self::ArrayLength {
            array,
            len,
            names: names.len(),
            first_names: names.iter().take(MOST_NAMED).cloned().collect(),
        }
    }
}

/// Lists the first names, of `count` in total.
fn listed(first_names: &[String], count: usize) -> String {
    let names = first_names.join(", ");
    match count - first_names.len() {
        0 => names,
        more => format!("{names} and {more} more"),
    }
}

fn of_encapsulation([first, second]: [u8; 2]) -> String {
    let known = match [first, second] {
        [0x28, 0xb5] => ", but compressed with Zstandard",
        [b'{', _] => ", but perhaps JSON",
        _ => "",
    };
    format!(
        "the message begins with {first:02x} {second:02x}: it is not plain CDR (00 00 or 00 01){known}"
    )
}

/// An error of encoding a message.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {type_name}: {source}")]
pub struct EncodeError {
    type_name: &'static str,
    source: cdr_encoding::Error,
}

/// Decodes the message of type `M` in `body`.
///
/// Memory is bounded by the length of `body`, whatever counts it declares.
///
/// # Errors
/// If `body` is not an `M`, or breaks its rules ([`Message::check`]).
pub fn decode<M: Message>(body: &[u8]) -> Result<M, DecodeError> {
    let mut message = M::default();
    decode_into(body, &mut message)?;
    Ok(message)
}

/// Like [`decode`], but into an existing message, whose memory is reused.
///
/// # Errors
/// As [`decode`]; the content of the message is then undefined.
pub fn decode_into<M: Message>(body: &[u8], message: &mut M) -> Result<(), DecodeError> {
    let Some((header, fields)) = body.split_first_chunk::<4>() else {
        return Err(DecodeError::TooShort { len: body.len() });
    };
    match [header[0], header[1]] {
        [0, 0] => read::<M, BigEndian>(fields, message)?,
        [0, 1] if message.read_alike(fields) => {}
        [0, 1] => read::<M, LittleEndian>(fields, message)?,
        id => return Err(DecodeError::Encapsulation { id }),
    }
    message.check()
}

fn read<M: Message, BO: ByteOrder>(fields: &[u8], message: &mut M) -> Result<(), DecodeError> {
    let mut from = CdrDeserializer::<BO>::new(fields);
    let result = message.read(&mut from);
    let consumed = from.bytes_consumed();
    result.map_err(|source| DecodeError::Fields {
        at: consumed + ENCAPSULATION.len(),
        len: fields.len() + ENCAPSULATION.len(),
        source,
    })?;
    let extra = fields.len() - consumed;
    if extra > MAX_PADDING {
        return Err(DecodeError::LeftOver {
            extra,
            type_name: M::TYPE,
        });
    }
    Ok(())
}

/// Encodes `message` as little-endian CDR into `body`, and replaces its content.
///
/// # Errors
/// If a string or array is longer than the format supports.
pub fn encode<M: Message>(message: &M, body: &mut Vec<u8>) -> Result<(), EncodeError> {
    body.clear();
    body.extend_from_slice(&ENCAPSULATION);
    cdr_encoding::to_writer::<M, LittleEndian, _>(body, message).map_err(|source| EncodeError {
        type_name: M::TYPE,
        source,
    })
}
