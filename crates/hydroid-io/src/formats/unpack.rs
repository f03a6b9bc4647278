//! Decompression into a buffer that is used again.

use std::io::{self, Read, Write};

use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use crate::input::LARGEST_PART;

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

/// What the parts of a file may unpack to, all together: the largest part, and 1,000 bytes for each byte of the file.
/// DEFLATE packs at most 1,032 to 1, and logs far less. Without the limit, messages that are packed within packed
/// chunks make terabytes of a few kilobytes.
#[derive(Debug)]
pub(crate) struct Allowance(u64);

impl Allowance {
    /// For a file of this length.
    pub(crate) fn new(length: u64) -> Self {
        Self(length.saturating_mul(1000).saturating_add(LARGEST_PART as u64))
    }

    /// Takes a number of bytes; an error if that many are not left.
    pub(crate) fn take(&mut self, bytes: usize) -> Result<(), &'static str> {
        let enough = bytes as u64 <= self.0;
        self.0 = self.0.saturating_sub(bytes as u64);
        if enough {
            Ok(())
        } else {
            Err("is not unpacked: the file unpacks to more than 1,000 times its length")
        }
    }
}

/// Decompression whose memory is used again.
pub(crate) struct Unpacker {
    zstd: FrameDecoder,
    allowance: Allowance,
}

/// Largest window of a frame of Zstandard, which the decoder has in memory.
const LARGEST_WINDOW: u64 = 64 << 20;

/// A decoder of Zstandard with a limited window.
pub(crate) fn zstd() -> FrameDecoder {
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(LARGEST_WINDOW);
    decoder
}

impl Unpacker {
    /// For the parts of a file of this length.
    pub(crate) fn new(length: u64) -> Self {
        Self { zstd: zstd(), allowance: Allowance::new(length) }
    }

    /// Decompresses into `out`, whose content is replaced, at most [`LARGEST_PART`] bytes. After an error `out` has the
    /// bytes that came before it.
    pub(crate) fn unpack(&mut self, codec: Codec, packed: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
        out.clear();
        // A byte more than is left, for the reason.
        if self.allowance.0 == 0 {
            self.allowance.take(1)?;
        }
        let left = usize::try_from(self.allowance.0).unwrap_or(usize::MAX);
        let bounded = &mut Bounded { out, most: left.min(LARGEST_PART) };
        let result = match codec {
            Codec::Zstd => unzstd(&mut self.zstd, packed, bounded),
            Codec::Lz4 => unlz4(packed, bounded),
            Codec::Bzip2 => io::copy(&mut bzip2::read::MultiBzDecoder::new(packed), bounded).map(|_| ()),
        };
        // What did not fit is taken, too.
        let over = usize::from(result.is_err() && bounded.out.len() == left);
        self.allowance.take(bounded.out.len() + over)?;
        result.map_err(|error| format!("cannot be decompressed ({error})"))
    }
}

/// A buffer that takes a number of bytes, and no more memory than that.
pub(crate) struct Bounded<'a> {
    pub(crate) out: &'a mut Vec<u8>,
    pub(crate) most: usize,
}

impl Write for Bounded<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let size = bytes.len().min(self.most.saturating_sub(self.out.len()));
        if self.out.capacity() - self.out.len() < size {
            // Twice the memory as a rule, but not beyond the limit.
            let more = self.out.len().max(size).min(self.most - self.out.len());
            self.out.reserve_exact(more);
        }
        self.out.extend_from_slice(&bytes[..size]);
        if size < bytes.len() { Err(io::Error::other("it is too big")) } else { Ok(size) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Bytes that note whether more of them were wanted than there are: the decoder of LZ4 takes an end between two blocks
/// for the end of the frame.
struct Packed<'a> {
    rest: &'a [u8],
    cut: bool,
}

impl Read for Packed<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.cut |= into.len() > self.rest.len();
        self.rest.read(into)
    }
}

/// Content of frames of LZ4 that follow each other.
fn unlz4(packed: &[u8], out: &mut Bounded) -> io::Result<()> {
    let mut packed = Packed { rest: packed, cut: false };
    while !packed.rest.is_empty() {
        io::copy(&mut lz4_flex::frame::FrameDecoder::new(&mut packed), out)?;
        if packed.cut {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
    Ok(())
}

/// Appends the content of frames of Zstandard that follow each other to a buffer.
pub(crate) fn unzstd(decoder: &mut FrameDecoder, mut packed: &[u8], out: &mut Bounded) -> io::Result<()> {
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
        }
    }
    Ok(())
}
