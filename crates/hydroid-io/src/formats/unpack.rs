//! Decompression into a buffer that is used again.

use std::io::{self, Read};

use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// First bytes of a frame of Zstandard (RFC 8878, section 3.1.1).
pub(crate) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// A compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    Zstd,
    /// LZ4 frame format.
    Lz4,
    Bzip2,
}

/// Decompression whose memory is used again.
pub(crate) struct Unpacker {
    zstd: FrameDecoder,
}

/// Largest window of a frame of Zstandard, which the decoder has in memory.
const LARGEST_WINDOW: u64 = 64 << 20;

/// A decoder of Zstandard with a limited window.
pub(crate) fn zstd() -> FrameDecoder {
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(LARGEST_WINDOW);
    decoder
}

impl Default for Unpacker {
    fn default() -> Self {
        Self { zstd: zstd() }
    }
}

impl Unpacker {
    /// Decompresses into `out`, whose content is replaced, at most `most` bytes. After an error `out` has the bytes
    /// that came before it.
    pub(crate) fn unpack(
        &mut self,
        codec: Codec,
        packed: &[u8],
        out: &mut Vec<u8>,
        most: usize,
    ) -> Result<(), String> {
        out.clear();
        match codec {
            Codec::Zstd => unzstd(&mut self.zstd, packed, out, most),
            Codec::Lz4 => read_all(lz4_flex::frame::FrameDecoder::new(packed), out, most),
            Codec::Bzip2 => read_all(bzip2::read::MultiBzDecoder::new(packed), out, most),
        }
        .map_err(|error| format!("cannot be decompressed ({error})"))
    }
}

fn read_all(from: impl Read, out: &mut Vec<u8>, most: usize) -> io::Result<()> {
    let read = from.take(most as u64).read_to_end(out)?;
    if read == most {
        return Err(io::Error::other("it is too big"));
    }
    Ok(())
}

/// Appends the content of frames of Zstandard that follow each other to `out`, until it has more than `most` bytes.
pub(crate) fn unzstd(
    decoder: &mut FrameDecoder,
    mut packed: &[u8],
    out: &mut Vec<u8>,
    most: usize,
) -> io::Result<()> {
    const STEP: usize = 1 << 20;
    /// A last block without content (RFC 8878, section 3.1.1.2), and room for a checksum.
    const END: &[u8] = &[1, 0, 0, 0, 0, 0, 0];
    while !packed.is_empty() {
        decoder.reset(&mut packed).map_err(io::Error::other)?;
        while !decoder.is_finished() {
            let result = decoder.decode_blocks(&mut packed, BlockDecodingStrategy::UptoBytes(STEP));
            if result.is_err() {
                // The decoder keeps a window back until the frame ends. An end gives what the whole blocks contain.
                let _ = decoder.decode_blocks(END, BlockDecodingStrategy::UptoBlocks(1));
            }
            decoder.collect_to_writer(&mut *out)?;
            result.map_err(io::Error::other)?;
            if out.len() > most {
                return Err(io::Error::other("it is too big"));
            }
        }
    }
    Ok(())
}
