//! Atomic writing of files.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Error of writing a file. No incomplete file remains.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}; name a place in a folder that can be written", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Error of the system.
    pub source: io::Error,
}

/// Writes a temporary file in the same folder and renames it to `path`. Creates missing folders.
///
/// # Errors
/// If a folder or the file cannot be written, or `content` fails.
pub fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let attempt = || -> io::Result<()> {
        // The target of a link is replaced, not the link. A device or a pipe cannot be replaced.
        let resolved = path.canonicalize();
        let path = resolved.as_deref().unwrap_or(path);
        if path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let mut out = io::BufWriter::new(std::fs::OpenOptions::new().write(true).open(path)?);
            content(&mut out)?;
            return out.flush();
        }
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(folder)?;
        let mut builder = tempfile::Builder::new();
        // Temporary files are private; the new file gets the permissions of other new files.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o644));
        }
        let mut file = builder.prefix(".hydroid-").tempfile_in(folder)?;
        let mut buffered = io::BufWriter::new(&mut file);
        content(&mut buffered)?;
        buffered.flush()?;
        drop(buffered);
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    attempt().map_err(|source| WriteError { path: path.to_owned(), source })
}

/// Creates a folder and checks that it is writable.
///
/// # Errors
/// If the folder cannot be created or written.
pub fn probe(folder: &Path) -> Result<(), WriteError> {
    let attempt = || -> io::Result<()> {
        if folder.is_file() {
            return Err(io::Error::new(io::ErrorKind::NotADirectory, "it is a file, and a folder is needed"));
        }
        std::fs::create_dir_all(folder)?;
        tempfile::Builder::new().prefix(".hydroid-").tempfile_in(folder).map(drop)
    };
    attempt().map_err(|source| WriteError { path: folder.to_owned(), source })
}
