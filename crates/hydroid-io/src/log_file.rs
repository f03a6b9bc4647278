//! Files on disk and in memory.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file on disk, or its name and content in memory, as in a browser.
#[derive(Clone, Debug)]
pub struct LogFile {
    path: PathBuf,
    content: Option<Content>,
}

/// Bytes that several readers share. They stay where they are: a copy of a large file takes as much memory again.
#[derive(Clone, Debug)]
struct Content(Arc<Vec<u8>>);

impl AsRef<[u8]> for Content {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl LogFile {
    /// A file in memory; `name` stands for its path in messages.
    pub fn in_memory(name: impl Into<PathBuf>, content: impl Into<Vec<u8>>) -> Self {
        Self { path: name.into(), content: Some(Content(Arc::new(content.into()))) }
    }

    /// Its path or name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its path or name in messages.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.content.is_none() && self.path.is_dir()
    }

    /// Whether it can be read more than once: a pipe cannot.
    pub fn is_file(&self) -> bool {
        self.content.is_some() || self.path.metadata().is_ok_and(|metadata| metadata.is_file())
    }

    /// A stream over the file from its start.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub fn open(&self) -> io::Result<Stream> {
        Ok(Stream(match &self.content {
            Some(content) => Kind::Memory(Cursor::new(content.clone())),
            None => Kind::Disk(File::open(&self.path)?),
        }))
    }

    /// A file on disk beside this one, whose name has a suffix; none if there is none.
    pub(crate) fn beside(&self, suffix: &str) -> Option<Self> {
        let mut path = self.path.clone().into_os_string();
        path.push(suffix);
        let beside = Self::from(&PathBuf::from(path));
        (self.content.is_none() && beside.is_file()).then_some(beside)
    }
}

impl<P: AsRef<Path> + ?Sized> From<&P> for LogFile {
    fn from(path: &P) -> Self {
        Self { path: path.as_ref().to_owned(), content: None }
    }
}

impl From<&Self> for LogFile {
    fn from(source: &Self) -> Self {
        source.clone()
    }
}

/// An open [`LogFile`].
#[derive(Debug)]
pub struct Stream(Kind);

#[derive(Debug)]
enum Kind {
    Disk(File),
    Memory(Cursor<Content>),
}

impl Stream {
    /// Its length now; a pipe has none.
    ///
    /// # Errors
    /// If the file has no properties that can be read.
    pub fn length(&self) -> io::Result<u64> {
        match &self.0 {
            Kind::Disk(file) => Ok(file.metadata()?.len()),
            Kind::Memory(content) => Ok(content.get_ref().0.len() as u64),
        }
    }
}

impl Read for Stream {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match &mut self.0 {
            Kind::Disk(file) => file.read(into),
            Kind::Memory(content) => content.read(into),
        }
    }
}

impl Seek for Stream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.0 {
            Kind::Disk(file) => file.seek(to),
            Kind::Memory(content) => content.seek(to),
        }
    }
}
