//! The library in an FMU: where it is, and for which platform.

use std::path::{Path, PathBuf};

use super::{FmuError, MARK, Version};

/// Names of the library on Linux, macOS and Windows.
const NAMES: [&str; 3] = ["libhydroid_fmu.so", "libhydroid_fmu.dylib", "hydroid_fmu.dll"];

/// Environment variable with the path of the library.
pub const LIBRARY_VARIABLE: &str = "HYDROID_FMU_LIBRARY";

/// A platform for which a library is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Platform {
    /// Folder of FMI 3.
    tuple: &'static str,
    /// Folder of FMI 2.
    second: &'static str,
    /// Extension of a library, with its dot.
    pub(super) extension: &'static str,
}

const LINUX: &str = ".so";
const MACOS: &str = ".dylib";
const WINDOWS: &str = ".dll";

impl Platform {
    /// Folder in `binaries`.
    pub fn folder(&self, version: Version) -> &'static str {
        match version {
            Version::V2 => self.second,
            Version::V3 => self.tuple,
        }
    }

    /// The platform of a library from its header: ELF, Mach-O or PE with 64 bits.
    pub fn of(library: &[u8]) -> Option<Self> {
        let platform = |tuple, second, extension| Some(Self { tuple, second, extension });
        let half = |at: usize| Some(u16::from_le_bytes(library.get(at..at + 2)?.try_into().ok()?));
        let word =
            |at: usize| Some(u32::from_le_bytes(library.get(at..at.checked_add(4)?)?.try_into().ok()?));
        if library.starts_with(b"\x7fELF\x02\x01") {
            return match half(18)? {
                62 => platform("x86_64-linux", "linux64", LINUX),
                183 => platform("aarch64-linux", "aarch64-linux", LINUX),
                _ => None,
            };
        }
        if word(0)? == 0xfeed_facf {
            return match word(4)? {
                0x0100_0007 => platform("x86_64-darwin", "darwin64", MACOS),
                0x0100_000c => platform("aarch64-darwin", "aarch64-darwin", MACOS),
                _ => None,
            };
        }
        if library.starts_with(b"MZ") {
            let at = usize::try_from(word(0x3c)?).ok()?;
            if word(at)? != u32::from_le_bytes(*b"PE\0\0") {
                return None;
            }
            return match half(at + 4)? {
                0x8664 => platform("x86_64-windows", "win64", WINDOWS),
                0xaa64 => platform("aarch64-windows", "aarch64-windows", WINDOWS),
                _ => None,
            };
        }
        None
    }
}

/// Reads a library and checks that it is the one of this version.
pub(super) fn read(path: &Path) -> Result<(Platform, Vec<u8>), FmuError> {
    let library = std::fs::read(path)
        .map_err(|error| FmuError::Read { path: path.to_owned(), reason: error.to_string() })?;
    let platform = Platform::of(&library).ok_or_else(|| FmuError::Platform { path: path.to_owned() })?;
    let mark = MARK.as_bytes();
    if !library.windows(mark.len()).any(|window| window == mark) {
        return Err(FmuError::Version { path: path.to_owned() });
    }
    Ok((platform, library))
}

/// The library of this computer: the one of [`LIBRARY_VARIABLE`], else beside the running program, else in `../lib` of it.
///
/// # Errors
/// If there is none, with the places that were searched.
pub fn find() -> Result<PathBuf, FmuError> {
    if let Some(path) = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()) {
        return Ok(PathBuf::from(path));
    }
    let program = std::env::current_exe().unwrap_or_default();
    // A link to the program stands elsewhere than the library.
    let program = program.canonicalize().unwrap_or(program);
    let folder = program.parent().map(Path::to_path_buf).unwrap_or_default();
    let folders = [folder.clone(), folder.join("../lib")];
    let places = folders.iter().flat_map(|folder| NAMES.map(|name| folder.join(name)));
    places.into_iter().find(|path| path.is_file()).ok_or(FmuError::NoLibrary { folder })
}
