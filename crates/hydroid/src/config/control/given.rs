//! Whether options are given.

pub(super) trait Given {
    fn is_given(&self) -> bool;
}

impl<T> Given for Option<T> {
    fn is_given(&self) -> bool {
        self.is_some()
    }
}

impl Given for bool {
    fn is_given(&self) -> bool {
        *self
    }
}

/// The first one of some options that is given.
macro_rules! first {
    ($of:expr, $($name:ident)*) => {{
        use super::given::Given as _;
        [$((stringify!($name), $of.$name.is_given())),*].into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }};
}
