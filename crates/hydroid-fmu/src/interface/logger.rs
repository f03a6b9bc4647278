//! Messages to the importer.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use super::ERROR;

/// `fmi2CallbackLogger`; its further arguments are those of the format in the message.
pub type Log2 = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi3LogMessageCallback`.
pub type Log3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

const CATEGORY: &CStr = c"logStatusError";

#[derive(Clone, Copy, Debug)]
pub(super) enum Call {
    Nothing,
    Second(Log2),
    Third(Log3),
}

/// The logger of an instance.
#[derive(Clone, Debug)]
pub(super) struct Logger {
    pub(super) call: Call,
    /// Address of the environment of the importer, which is handed back and never read.
    pub(super) environment: usize,
    pub(super) name: CString,
}

/// A text for C, without zeros.
pub(super) fn c_text(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|byte| *byte != 0).collect();
    CString::new(bytes).unwrap_or_default()
}

impl Logger {
    pub(super) fn error(&self, message: &str) {
        let environment = self.environment as *mut c_void;
        match self.call {
            Call::Nothing => {}
            Call::Second(log) => {
                // The message is a format of `printf`.
                let message = c_text(&message.replace('%', "%%"));
                // The function is the one of the importer, and all texts end with a zero.
                unsafe { log(environment, self.name.as_ptr(), ERROR, CATEGORY.as_ptr(), message.as_ptr()) };
            }
            Call::Third(log) => {
                let message = c_text(message);
                // The function is the one of the importer, and all texts end with a zero.
                unsafe { log(environment, ERROR, CATEGORY.as_ptr(), message.as_ptr()) };
            }
        }
    }
}
