//! Terms and constraints.

use std::sync::Arc;

use hydroid::model::{Body, Model};
use hydroid::sindy::expression::ExpressionParser;
use hydroid_core::model::sparse::Equations;

use crate::{exercise, models};

/// What is read as a term is printed as one that reads the same, and evaluated in equations.
pub fn expression(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut parser = ExpressionParser::new(["u", "r", "n", "delta"], 2, models::DT);
    let _ = ExpressionParser::new(["u", "wind_x", "a.b [c]"], 1, models::DT).term(text);
    let _ = parser.constraint(text);
    let Ok(term) = parser.term(text) else { return };
    let name = term.name(&parser.names());
    assert_eq!(parser.term(&name).as_ref(), Ok(&term), "{name}");
    let signals = parser.signals().to_vec();
    let equations = Equations::with_signals(vec![term], vec![0.3, -0.7], 2, 2, signals, models::DT, 1);
    let Ok(equations) = equations else { return };
    exercise::model(&Model { body: Body::Equations(Arc::new(equations)), ..models::model("equations") });
}
