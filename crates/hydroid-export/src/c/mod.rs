//! C99: a header and a source, without allocation and without dependencies but `math.h`.
//!
//! The state is a struct of fixed size. Functions have no recursion, and their loops have constant bounds.

mod function;
mod helpers;
mod number;
mod text;

use hydroid::model::Model;

use crate::name::identifier;
use crate::state_space::StateSpace;
use crate::{File, Options};

pub use number::Precision;

/// Writes a model as `NAME.h` and `NAME.c`.
pub(crate) fn export(model: &Model, options: &Options, precision: Precision) -> Vec<File> {
    let space = StateSpace::of(model);
    let name = identifier(&options.name);
    let file = text::Text { name: &name, model, space: &space, precision };
    vec![
        File { name: format!("{name}.h"), content: file.header().into_bytes() },
        File { name: format!("{name}.c"), content: file.source().into_bytes() },
    ]
}
