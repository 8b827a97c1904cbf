//! Sorts the summary of a finished MCAP file.
//!
//! The mcap crate writes the schemas and channels of the summary in the order of a hash map, which differs each time.
//! Nothing else in the file depends on it, so the two groups are sorted by number in place, and the CRC of the
//! summary is recomputed.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use mcap::records::op;

use crate::mcap_file::{CRC_FROM_END_BYTES, read_footer, summary_crc};

/// Opcode and length before each record \[bytes\].
/// Physical: the MCAP format: an opcode of 1 byte and a length of 8.
const PREFIX_BYTES: usize = 9;

pub(super) fn sort(mut file: &File) -> io::Result<()> {
    let file_bytes = file.metadata()?.len();
    let Some(footer) = read_footer(file, file_bytes)? else {
        return Ok(());
    };
    if footer.summary_start == 0 {
        return Ok(());
    }
    // Schemas and channels come first, so only they are read into memory.
    let mut records: Vec<Vec<u8>> = Vec::new();
    file.seek(SeekFrom::Start(footer.summary_start))?;
    let mut reader = io::BufReader::new(file);
    loop {
        let mut record = vec![0; PREFIX_BYTES];
        reader.read_exact(&mut record)?;
        if !matches!(record[0], op::SCHEMA | op::CHANNEL) {
            break;
        }
        let mut len = [0; 8];
        len.copy_from_slice(&record[1..]);
        let len = u64::from_le_bytes(len);
        (&mut reader).take(len).read_to_end(&mut record)?;
        records.push(record);
    }
    // Opcode first: schemas stay before channels. Both begin with their number.
    let number = |record: &Vec<u8>| {
        let body = &record[PREFIX_BYTES..];
        (record[0], body.get(1).copied(), body.first().copied())
    };
    records.sort_by_key(number);
    file.seek(SeekFrom::Start(footer.summary_start))?;
    file.write_all(&records.concat())?;

    let crc = summary_crc(file, footer.summary_start, file_bytes)?;
    file.seek(SeekFrom::Start(file_bytes - CRC_FROM_END_BYTES))?;
    file.write_all(&crc.to_le_bytes())
}
