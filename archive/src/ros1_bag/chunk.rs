//! A chunk: its decompressed records.

use std::io::{self, Read};

use super::record::{Header, Records, Step, op};
use crate::chunks::{MAX_LOADED_BYTES, too_long};

/// Reader of chunks, with memory that is reused from one to the next.
#[derive(Default)]
pub(super) struct Unpacker {
    packed: Vec<u8>,
}

impl Unpacker {
    /// Reads the chunk at `at` into `records`. A truncated chunk is read up to its end.
    ///
    /// # Errors
    /// The inner error is the reason why it cannot be decompressed; the content of `records` is then undefined.
    pub(super) fn read(
        &mut self,
        from: &mut Records,
        at: u64,
        torn: bool,
        records: &mut Vec<u8>,
    ) -> io::Result<Result<(), String>> {
        from.go_to(at)?;
        let (Step::Record(head)
        | Step::Torn {
            head: Some(head), ..
        }) = from.step()?
        else {
            return Ok(Err("there is no record".to_owned()));
        };
        let header = Header(&head.header);
        if header.op() != Some(op::CHUNK) {
            return Ok(Err("the index leads to something else".to_owned()));
        }
        if head.data_len > MAX_LOADED_BYTES as u64 {
            return Ok(Err(too_long(head.data_len)));
        }
        from.data(&head, &mut self.packed)?;
        Ok(unpack(header, &self.packed, torn, records))
    }
}

fn unpack(
    header: Header<'_>,
    packed: &[u8],
    torn: bool,
    records: &mut Vec<u8>,
) -> Result<(), String> {
    records.clear();
    let size = u64::from(header.u32("size").ok_or("it does not say its size")?);
    if size > MAX_LOADED_BYTES as u64 {
        return Err(format!("it unpacks to {}", too_long(size)));
    }
    // At most the declared size, whatever the content: memory is allocated as bytes are decompressed.
    let limit = size + 1;
    let read = match header.get("compression").unwrap_or_default() {
        b"none" => packed.take(limit).read_to_end(records),
        b"bz2" => bzip2::read::BzDecoder::new(packed)
            .take(limit)
            .read_to_end(records),
        b"lz4" => {
            lz4::Decoder::new(packed).and_then(|decoder| decoder.take(limit).read_to_end(records))
        }
        other => {
            let other = String::from_utf8_lossy(other);
            return Err(format!("compression {other:?} is not known"));
        }
    };
    if torn {
        return Ok(());
    }
    match read {
        Err(error) => Err(format!("it cannot be unpacked: {error}")),
        Ok(_) if records.len() as u64 != size => Err(format!(
            "it unpacks to {} bytes, its header says {size}",
            if records.len() as u64 > size {
                "more".to_owned()
            } else {
                records.len().to_string()
            }
        )),
        Ok(_) => Ok(()),
    }
}
