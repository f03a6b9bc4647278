//! One sequence at a time: a step of the network, and its derivatives.

mod blocks;
mod gates;
pub(crate) mod linearization;
pub(crate) mod packed;
pub(crate) mod products;
mod sums;
mod transposed;

pub use blocks::Blocks;
pub use linearization::{LayerPartials, Linearization};
pub use packed::Packed;
pub use products::Change;
pub use transposed::Gradient;
