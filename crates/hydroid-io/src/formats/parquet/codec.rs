//! Compression of pages: Apache Parquet format, "Compression".

use std::io::Read;

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};

use super::thrift::Part;

/// Largest window of a frame of Zstandard, which the decoder holds in memory.
const LARGEST_WINDOW: u64 = 64 << 20;

/// Decoders that are used again for each page.
pub(super) struct Codecs {
    zstd: FrameDecoder,
    snappy: snap::raw::Decoder,
}

impl Codecs {
    pub(super) fn new() -> Self {
        let mut zstd = FrameDecoder::new();
        zstd.set_max_window_size(LARGEST_WINDOW);
        Self { zstd, snappy: snap::raw::Decoder::new() }
    }

    /// Appends the content of `packed`, of `size` bytes, to `out`.
    pub(super) fn unpack(&mut self, codec: i64, packed: &[u8], size: usize, out: &mut Vec<u8>) -> Part<()> {
        const WRONG: &str = "a page cannot be decompressed";
        let start = out.len();
        match codec {
            0 => out.extend_from_slice(packed),
            // Each 3 bytes of Snappy give at most 64, so the size that is stated is limited before it is reserved.
            1 if size / 64 > packed.len() => return Err(WRONG),
            1 => {
                if snap::raw::decompress_len(packed).ok() != Some(size) {
                    return Err(WRONG);
                }
                out.resize(start + size, 0);
                self.snappy.decompress(packed, &mut out[start..]).map_err(|_| WRONG)?;
            }
            2 => {
                let content = flate2::read::MultiGzDecoder::new(packed);
                content.take(size as u64 + 1).read_to_end(out).map_err(|_| WRONG)?;
            }
            6 => unzstd(&mut self.zstd, packed, size, out).map_err(|()| WRONG)?,
            // Each byte of LZ4 gives at most 255.
            7 if size / 256 > packed.len() => return Err(WRONG),
            7 => {
                out.resize(start + size, 0);
                let written =
                    lz4_flex::block::decompress_into(packed, &mut out[start..]).map_err(|_| WRONG)?;
                out.truncate(start + written);
            }
            3 => return Err("the codec LZO is not supported; write the file with Zstandard"),
            4 => return Err("the codec Brotli is not supported; write the file with Zstandard"),
            5 => {
                return Err(
                    "the codec LZ4 (Hadoop) is not supported; write the file with LZ4_RAW or Zstandard",
                );
            }
            _ => return Err("the codec is unknown"),
        }
        if out.len() - start == size { Ok(()) } else { Err("a page has not the size that it states") }
    }
}

/// Appends the content of the frames of Zstandard (RFC 8878) to `out`; an error if it is longer than `cap`.
fn unzstd(decoder: &mut FrameDecoder, mut packed: &[u8], cap: usize, out: &mut Vec<u8>) -> Result<(), ()> {
    let start = out.len();
    while !packed.is_empty() {
        let left = cap.checked_sub(out.len() - start).ok_or(())?;
        let mut frame = StreamingDecoder::new_with_decoder(packed, &mut *decoder).map_err(drop)?;
        // The buffer grows with the content.
        frame.by_ref().take(left as u64 + 1).read_to_end(out).map_err(drop)?;
        packed = frame.into_inner();
        if out.len() - start > cap {
            return Err(());
        }
    }
    Ok(())
}
