//! Reading of a file without index, block by block.

use crate::error::IoError;
use crate::input::Input;
use crate::sink::Sink;

/// Least length of a block that is not the last one. No record is longer.
pub(crate) const BLOCK: usize = 1 << 20;

/// Bytes of a file in memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block<'a> {
    pub(crate) bytes: &'a [u8],
    /// Place of the first byte in the file.
    pub(crate) offset: u64,
    /// Whether the file ends with the block.
    pub(crate) last: bool,
}

impl Block<'_> {
    /// Place in the file of a byte of the block.
    pub(crate) fn place(&self, at: usize) -> u64 {
        self.offset.saturating_add(at as u64)
    }
}

/// Gives a file block by block to `read`, which answers how many bytes it has used. The next block begins there.
pub(crate) fn blocks(
    input: &mut Input,
    sink: &mut dyn Sink,
    mut read: impl FnMut(Block<'_>, &mut dyn Sink) -> usize,
) -> Result<(), IoError> {
    loop {
        let offset = input.offset();
        let length = input.window(BLOCK)?.len();
        let last = input.rest() <= length as u64;
        let bytes = input.window(BLOCK)?;
        let used = read(Block { bytes, offset, last }, sink);
        if last {
            return Ok(());
        }
        // A block that nothing has been used of would come again for ever.
        input.skip(used.max(1) as u64)?;
        input.tell(sink)?;
    }
}
