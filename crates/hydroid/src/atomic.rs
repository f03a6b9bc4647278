//! Atomic writing of files.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::Duration;

use web_time::Instant;

/// Held for reading by writers of files, and for writing when the program is to end.
static WRITERS: RwLock<()> = RwLock::new(());

/// Waits until no work has been held for `quiet` without a break, for `quiet` and `longest` together at most, and keeps new
/// work from being begun until the guard is dropped. The caller then ends the program.
///
/// The break counts: work that is released for a moment, as for a write that may block, is not ended in that moment.
pub fn settle(quiet: Duration, longest: Duration) -> Option<RwLockWriteGuard<'static, ()>> {
    let begun = Instant::now();
    let mut free_since = None;
    loop {
        let guard = match WRITERS.try_write() {
            Err(std::sync::TryLockError::WouldBlock) => None,
            Err(std::sync::TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Ok(guard) => Some(guard),
        };
        match guard {
            Some(guard) if free_since.get_or_insert_with(Instant::now).elapsed() >= quiet => {
                return Some(guard);
            }
            Some(guard) => drop(guard),
            None => free_since = None,
        }
        if begun.elapsed() >= quiet + longest {
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Error of writing a file. No incomplete file remains.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}; name a place in a folder that can be written", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Error of the system.
    pub source: io::Error,
}

/// Keeps [`settle`] waiting while work is done that belongs together, such as the files of one end of a run.
pub fn hold() -> RwLockReadGuard<'static, ()> {
    WRITERS.read().unwrap_or_else(PoisonError::into_inner)
}

/// Names of temporary files: prefix, random letters and digits, suffix.
const TEMPORARY: [&str; 2] = [".hydroid-", ".tmp"];
const RANDOM: usize = 6;

fn is_temporary(name: &str) -> bool {
    let [prefix, suffix] = TEMPORARY;
    let random = name.strip_prefix(prefix).and_then(|rest| rest.strip_suffix(suffix));
    random.is_some_and(|random| {
        random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

fn temporary_file() -> tempfile::Builder<'static, 'static> {
    let [prefix, suffix] = TEMPORARY;
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix).suffix(suffix).rand_bytes(RANDOM);
    builder
}

/// Folders that this program has cleaned.
static CLEANED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Removes temporary files of dead runs from a folder, once for each program: their writers held a lock.
fn clean(folder: &Path) {
    let mut cleaned = CLEANED.lock().unwrap_or_else(PoisonError::into_inner);
    if !cleaned.insert(folder.to_owned()) {
        return;
    }
    drop(cleaned);
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if !is_temporary(&entry.file_name().to_string_lossy()) || !entry.path().is_file() {
            continue;
        }
        if let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// A place that no other run may write while this value exists.
#[derive(Debug)]
pub struct Lock {
    /// The locked file and its path; `None` for devices and pipes.
    held: Option<(File, PathBuf)>,
}

impl Lock {
    /// Locks a file that is to be written, by a file `.NAME.lock` beside it, or a folder, by a file `.hydroid.lock` in it.
    /// Where the file system has no locks, nothing is refused.
    ///
    /// # Errors
    /// If another run writes there, or the lock cannot be created.
    pub fn new(path: &Path) -> Result<Self, WriteError> {
        let failed = |source| WriteError { path: path.to_owned(), source };
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let place = match whole.metadata() {
            Ok(metadata) if metadata.is_dir() => whole.join(".hydroid.lock"),
            Ok(metadata) if !metadata.is_file() => return Ok(Self { held: None }),
            _ => {
                let folder = whole.parent().filter(|folder| !folder.as_os_str().is_empty());
                let folder = folder.unwrap_or(Path::new("."));
                std::fs::create_dir_all(folder).map_err(failed)?;
                let name = whole.file_name().unwrap_or_default().to_string_lossy();
                folder.join(format!(".{name}.lock"))
            }
        };
        loop {
            let file =
                File::options().create(true).truncate(false).write(true).open(&place).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let reason = "another run of hydroid writes there; wait for it, or name another place";
                    return Err(failed(io::Error::new(io::ErrorKind::ResourceBusy, reason)));
                }
                Err(TryLockError::Error(_)) => return Ok(Self { held: Some((file, place)) }),
            }
            // The last owner may have removed the file between the two calls.
            if is_at(&file, &place) {
                return Ok(Self { held: Some((file, place)) });
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Some((_, path)) = &self.held {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Whether a path still leads to an open file.
fn is_at(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        matches!((file.metadata(), path.metadata()), (Ok(a), Ok(b)) if (a.dev(), a.ino()) == (b.dev(), b.ino()))
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

/// Writes a temporary file in the same folder and renames it to `path`. Creates missing folders.
///
/// # Errors
/// If a folder or the file cannot be written, or `content` fails.
pub fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let _writing = hold();
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
        #[cfg_attr(not(unix), expect(unused_mut, reason = "other systems have no such permissions"))]
        let mut builder = temporary_file();
        // Temporary files are private; the new file gets the permissions of other new files.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o644));
        }
        clean(folder);
        let mut file = loop {
            let file = builder.tempfile_in(folder)?;
            match file.as_file().try_lock() {
                // Another run may have cleaned the file before it had its lock.
                Ok(()) if !is_at(file.as_file(), file.path()) => {}
                Err(TryLockError::WouldBlock) => {}
                // A file system without locks keeps the file from being cleaned, not from being written.
                Ok(()) | Err(TryLockError::Error(_)) => break file,
            }
        };
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
        clean(folder);
        temporary_file().tempfile_in(folder).map(drop)
    };
    attempt().map_err(|source| WriteError { path: folder.to_owned(), source })
}
