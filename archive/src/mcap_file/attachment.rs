//! Headers of attachments. The data of an attachment is copied without being loaded into memory.

use std::io::{self, Read};

use mcap::records::AttachmentHeader;

use crate::fields::Fields;

/// Maximum size of an attachment's header, which holds times, name and media type \[bytes\].
/// Resolution: bounds memory.
const MAX_HEADER_BYTES: u64 = 64 << 10;
/// Size of the checksum after an attachment's data \[bytes\].
/// Physical: the MCAP format: a CRC-32.
const CRC_BYTES: u64 = 4;

/// Parses the header at the front of an attachment record's body of `len` bytes. Returns it with the offset and the
/// length of the data; `None` if it is malformed.
pub(crate) fn attachment_header(
    from: &mut impl Read,
    len: u64,
) -> io::Result<Option<(AttachmentHeader, u64, u64)>> {
    let mut bytes = Vec::new();
    from.take(len.min(MAX_HEADER_BYTES))
        .read_to_end(&mut bytes)?;
    let mut fields = Fields(&bytes);
    let mut parse = || {
        let header = AttachmentHeader {
            log_time: fields.u64()?,
            create_time: fields.u64()?,
            name: fields.text()?.to_owned(),
            media_type: fields.text()?.to_owned(),
        };
        Some((header, fields.u64()?, fields.0.len()))
    };
    let Some((header, data_len, left)) = parse() else {
        return Ok(None);
    };
    let data_at = (bytes.len() - left) as u64;
    // Data and checksum fill the rest of the record, or the declared length is wrong.
    let end = data_at
        .checked_add(data_len)
        .and_then(|end| end.checked_add(CRC_BYTES));
    Ok((end == Some(len)).then_some((header, data_at, data_len)))
}
