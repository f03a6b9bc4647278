//! One sequence at a time, as on board: a step of the network, and its derivatives.

mod blocks;
mod dense;
mod gates;
mod linearization;
mod packed;
mod products;
mod sums;
mod transposed;

pub use blocks::Blocks;
pub use linearization::{LayerPartials, Linearization};
pub use packed::Packed;
pub use products::Change;
pub use transposed::Gradient;
