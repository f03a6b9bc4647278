//! Compression of pages: Apache Parquet format, "Compression".

use std::io::Read;

use ruzstd::decoding::FrameDecoder;

use super::super::unpack::{Allowance, Bounded, unzstd, zstd};
use super::thrift::Part;

/// Decoders that are used again for each page.
pub(super) struct Codecs {
    zstd: FrameDecoder,
    snappy: snap::raw::Decoder,
    allowance: Allowance,
}

impl Codecs {
    /// For the pages of a file of this length.
    pub(super) fn new(length: u64) -> Self {
        Self { zstd: zstd(), snappy: snap::raw::Decoder::new(), allowance: Allowance::new(length) }
    }

    /// Appends the content of `packed`, of `size` bytes, to `out`.
    pub(super) fn unpack(&mut self, codec: i64, packed: &[u8], size: usize, out: &mut Vec<u8>) -> Part<()> {
        const WRONG: &str = "a page cannot be decompressed";
        const TOO_MUCH: &str = "the pages of the file unpack to more than 1,000 times its length";
        let start = out.len();
        if codec != 0 {
            self.allowance.take(size).map_err(|_| TOO_MUCH)?;
        }
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
            6 => {
                unzstd(&mut self.zstd, packed, &mut Bounded { out, most: start + size })
                    .map_err(|_| WRONG)?;
            }
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
