//! A file as a window of bytes that moves forward.

use std::io::{Read, Seek, SeekFrom};

use crate::error::IoError;
use crate::log_file::{LogFile, Stream};
use crate::sink::Sink;

/// Longest part of a file that is in memory at once, packed or unpacked.
pub(crate) const LARGEST_PART: usize = 256 << 20;

const BLOCK: usize = 1 << 20;

/// A file, read forward through a buffer.
#[derive(Debug)]
pub(crate) struct Input {
    source: LogFile,
    path: String,
    file: Stream,
    /// Bytes of the file from `start`; the window is those from `at`.
    buffer: Vec<u8>,
    at: usize,
    start: u64,
    /// Length of the file when it was opened. A file that grows is read up to there.
    length: u64,
    told: u64,
}

impl Input {
    pub(crate) fn open(source: LogFile) -> Result<Self, IoError> {
        let path = source.name();
        let fail = |source| IoError::Read { path: path.clone(), source };
        let file = source.open().map_err(fail)?;
        let length = file.length().map_err(fail)?;
        Ok(Self { source, path, file, buffer: Vec::new(), at: 0, start: 0, length, told: 0 })
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    pub(crate) fn source(&self) -> &LogFile {
        &self.source
    }

    /// Length of the file.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Place of the window in the file.
    pub(crate) fn offset(&self) -> u64 {
        self.start + self.at as u64
    }

    /// Bytes from the window to the end of the file.
    pub(crate) fn rest(&self) -> u64 {
        self.length.saturating_sub(self.offset())
    }

    /// The next bytes without moving: at least `size` of them, or all that are left. `size` is at most
    /// [`LARGEST_PART`].
    pub(crate) fn window(&mut self, size: usize) -> Result<&[u8], IoError> {
        let size = size.min(LARGEST_PART);
        if self.buffer.len() - self.at < size {
            self.buffer.drain(..self.at);
            self.start += self.at as u64;
            self.at = 0;
            while self.buffer.len() < size {
                let left = self.length.saturating_sub(self.start + self.buffer.len() as u64);
                let wanted =
                    (size - self.buffer.len()).max(BLOCK).min(usize::try_from(left).unwrap_or(usize::MAX));
                if wanted == 0 {
                    break;
                }
                // The buffer has the memory of the longest window, and no more.
                self.buffer.reserve_exact(wanted);
                let read = (&mut self.file).take(wanted as u64).read_to_end(&mut self.buffer);
                if read.map_err(|source| IoError::Read { path: self.path.clone(), source })? == 0 {
                    self.length = self.start + self.buffer.len() as u64;
                }
            }
        }
        Ok(&self.buffer[self.at..])
    }

    /// Moves the window forward; beyond the buffer by seeking.
    pub(crate) fn skip(&mut self, bytes: u64) -> Result<(), IoError> {
        let to = self.offset().saturating_add(bytes).min(self.length);
        self.seek(to)
    }

    /// Moves the window to a place in the file.
    pub(crate) fn seek(&mut self, to: u64) -> Result<(), IoError> {
        if to >= self.start && to <= self.start + self.buffer.len() as u64 {
            self.at = usize::try_from(to - self.start).expect("a place in the buffer");
            return Ok(());
        }
        self.file
            .seek(SeekFrom::Start(to))
            .map_err(|source| IoError::Read { path: self.path.clone(), source })?;
        self.buffer.clear();
        self.at = 0;
        self.start = to;
        Ok(())
    }

    /// Appends up to `size` bytes from a place in the file to a buffer; fewer at its end. The window stays where it is:
    /// columns that are read in step have places of their own. `size` is at most [`LARGEST_PART`].
    pub(crate) fn read_at(&mut self, from: u64, size: usize, into: &mut Vec<u8>) -> Result<(), IoError> {
        let size = (size.min(LARGEST_PART) as u64).min(self.length.saturating_sub(from));
        let after = self.start + self.buffer.len() as u64;
        let mut read = || {
            self.file.seek(SeekFrom::Start(from))?;
            (&mut self.file).take(size).read_to_end(into)?;
            self.file.seek(SeekFrom::Start(after))
        };
        read().map_err(|source| IoError::Read { path: self.path.clone(), source })?;
        Ok(())
    }

    /// Reports the progress after each MB.
    pub(crate) fn tell(&mut self, sink: &mut dyn Sink) -> Result<(), IoError> {
        let done = self.offset();
        if done.abs_diff(self.told) >= BLOCK as u64 {
            self.told = done;
            if !sink.proceed(done, self.length) {
                return Err(IoError::Interrupted);
            }
        }
        Ok(())
    }

    /// An error of the file as a whole at this place.
    pub(crate) fn damaged(&self, reason: impl Into<String>, remedy: impl Into<String>) -> IoError {
        IoError::Damaged {
            path: self.path.clone(),
            offset: self.offset(),
            reason: reason.into(),
            remedy: remedy.into(),
        }
    }
}
