//! C99: a header and a source, without allocation and without dependencies but `math.h`.
//!
//! The state is a struct of fixed size. Functions have no recursion, and their loops have constant bounds. A model that
//! learns has a second struct of fixed size for the memory of its method.

mod adapter;
mod function;
mod helpers;
mod number;
mod text;

use hydroid::model::Model;

use crate::adapter::Adapter;
use crate::name::identifier;
use crate::state_space::StateSpace;
use crate::{ExportError, File, Options};

pub use number::Precision;

/// Options of the export to C.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct COptions {
    /// Type of the numbers.
    pub precision: Precision,
    /// Options of the method by which the exported model learns; `None` for constant weights.
    pub adapter: Option<Box<hydroid::adapt::Options>>,
}

impl From<Precision> for COptions {
    fn from(precision: Precision) -> Self {
        Self { precision, adapter: None }
    }
}

/// Writes a model as `NAME.h` and `NAME.c`.
pub(crate) fn export(
    model: &Model,
    options: &Options,
    COptions { precision, adapter }: &COptions,
) -> Result<Vec<File>, ExportError> {
    let adapter = adapter.as_ref().map(|options| Adapter::of(model, options)).transpose()?;
    let space = adapter.as_ref().map_or_else(|| StateSpace::of(model), |adapter| adapter.space.clone());
    let name = identifier(&options.name);
    let file =
        text::Text { name: &name, model, space: &space, adapter: adapter.as_ref(), precision: *precision };
    Ok(vec![
        File { name: format!("{name}.h"), content: file.header().into_bytes() },
        File { name: format!("{name}.c"), content: file.source().into_bytes() },
    ])
}
