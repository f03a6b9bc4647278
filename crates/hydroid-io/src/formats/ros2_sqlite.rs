//! Reader of ros2_sqlite.

use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary};

pub(crate) fn scan(input: &mut Input, _sink: &mut dyn Sink) -> Result<Summary, IoError> {
    Err(input.damaged("this format is not read yet", "convert it to CSV"))
}
