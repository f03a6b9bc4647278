//! Inputs of a vessel with their limits.

/// An input of a vessel. `P` is the place where its commands go, which experiments do not need.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis<P = ()> {
    /// Name, for messages.
    pub name: String,
    /// Where its commands go.
    pub place: P,
    pub low: f64,
    pub high: f64,
    /// Neutral command: the input has no effect.
    pub rest: f64,
}

impl Axis {
    /// An axis without a place.
    pub fn new(name: impl Into<String>, [low, high]: [f64; 2], rest: f64) -> Self {
        Self { name: name.into(), place: (), low, high, rest }
    }
}

impl<P> Axis<P> {
    /// The same axis at another place.
    pub fn at<Q>(self, place: Q) -> Axis<Q> {
        let Self { name, low, high, rest, .. } = self;
        Axis { name, place, low, high, rest }
    }
}
