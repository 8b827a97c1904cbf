//! Conversion of message bodies to CDR: decompression, and conversion from ROS 1.

use zstd::zstd_safe;

use crate::compressed::ZSTD_MAGIC;
use crate::ros::DecodeError;
use crate::ros1_convert::{Conversion, Converter};

/// Maximum size of a decompressed message \[bytes\].
/// Resolution: bounds memory.
const MAX_MESSAGE_BYTES: u64 = 64 << 20;

/// Reason why a stored body cannot be converted to CDR.
#[derive(Debug, Clone, Copy)]
pub(super) enum Flaw {
    /// Compressed data that cannot be decompressed.
    Compressed(&'static str),
    /// A body that is not a ROS 1 message of the declared type.
    Ros1(Conversion),
}

impl Flaw {
    /// Returns the error for a stored body of `len` bytes.
    pub(super) fn error(self, len: usize) -> DecodeError {
        match self {
            Self::Compressed(reason) => DecodeError::Compressed { reason },
            Self::Ros1(conversion) => DecodeError::Ros1 {
                len,
                type_name: conversion.type_name(),
            },
        }
    }
}

/// Converter of stored bodies to CDR, with reusable buffers.
#[derive(Default)]
pub(super) struct Bodies {
    /// Created for the first compressed message.
    decompressor: Option<zstd_safe::DCtx<'static>>,
    decompressed: Vec<u8>,
    converter: Converter,
    converted: Vec<u8>,
}

impl Bodies {
    /// Returns the message `stored` as CDR. In its mode `message`, rosbag2 compresses each message; the magic number
    /// of Zstandard identifies them, because no CDR message begins with it. A body that cannot be converted is
    /// returned unconverted, with the flaw.
    pub(super) fn cdr<'a>(
        &'a mut self,
        stored: &'a [u8],
        conversion: Option<Conversion>,
    ) -> (&'a [u8], Option<Flaw>) {
        let mut body = stored;
        if stored.starts_with(&ZSTD_MAGIC) {
            if let Err(reason) = decompress(&mut self.decompressor, stored, &mut self.decompressed)
            {
                return (stored, Some(Flaw::Compressed(reason)));
            }
            body = &self.decompressed;
        }
        let Some(of) = conversion else {
            return (body, None);
        };
        match self.converter.convert(of, body, &mut self.converted) {
            Ok(()) => (&self.converted, None),
            Err(_) => (body, Some(Flaw::Ros1(of))),
        }
    }
}

/// Decompresses `stored` over `into`.
///
/// # Errors
/// The reason, as a phrase for the message.
fn decompress(
    decompressor: &mut Option<zstd_safe::DCtx<'static>>,
    stored: &[u8],
    into: &mut Vec<u8>,
) -> Result<(), &'static str> {
    const TOO_LONG: &str = "it is longer than 64 MiB, which is the limit";
    let declared = zstd_safe::get_frame_content_size(stored).map_err(|_| "its header is broken")?;
    let bytes = declared.unwrap_or(MAX_MESSAGE_BYTES);
    if bytes > MAX_MESSAGE_BYTES {
        return Err(TOO_LONG);
    }
    if decompressor.is_none() {
        *decompressor = zstd_safe::DCtx::try_create();
    }
    let decompressor = decompressor.as_mut().ok_or("out of memory")?;
    into.clear();
    // Pages are allocated on first write, so an unknown size does not cost the full limit.
    into.reserve(bytes as usize);
    let decompressed = decompressor.decompress(into, stored);
    decompressed.map_err(zstd_safe::get_error_name)?;
    Ok(())
}
