//! Lists of nodes under construction.

use std::collections::HashMap;

use super::proto::{
    Attribute, Dimension, Graph, Node, Shape, Tensor, TensorType, Type, Value, attribute, element,
};
use crate::Precision;

/// Domain of the functions of a model.
pub(super) const DOMAIN: &str = "hydroid";

/// A size as a number of ONNX. No vector in memory is as long as `i64::MAX`.
pub(super) fn size(len: usize) -> i64 {
    i64::try_from(len).unwrap_or(i64::MAX)
}

/// Type of the numbers of a model.
pub(super) fn real(precision: Precision) -> i32 {
    match precision {
        Precision::Double => element::DOUBLE,
        Precision::Float => element::FLOAT,
    }
}

/// A dimension of a tensor.
#[derive(Clone, Copy, Debug)]
pub(super) enum Dim {
    Of(usize),
    /// Any size, by its name.
    Any(&'static str),
}

/// An input or output of a graph.
pub(super) fn value(name: &str, elements: i32, dims: &[Dim], about: &str) -> Value {
    let dim = |dim: &Dim| match *dim {
        Dim::Of(len) => Dimension { dim_value: Some(size(len)), dim_param: None },
        Dim::Any(name) => Dimension { dim_value: None, dim_param: Some(name.to_owned()) },
    };
    let shape = Shape { dim: dims.iter().map(dim).collect() };
    let tensor = TensorType { elem_type: Some(elements), shape: Some(shape) };
    Value {
        name: Some(name.to_owned()),
        r#type: Some(Type { tensor_type: Some(tensor) }),
        doc_string: (!about.is_empty()).then(|| about.to_owned()),
    }
}

/// An attribute that is a number.
pub(super) fn integer(name: &str, i: i64) -> Attribute {
    Attribute {
        name: Some(name.to_owned()),
        i: Some(i),
        r#type: Some(attribute::INT),
        ..Attribute::default()
    }
}

/// An attribute that is a graph.
pub(super) fn graph(name: &str, g: Graph) -> Attribute {
    Attribute {
        name: Some(name.to_owned()),
        g: Some(g),
        r#type: Some(attribute::GRAPH),
        ..Attribute::default()
    }
}

/// Nodes with names of their own. A value is named by the prefix of the list and a number.
pub(super) struct Nodes {
    pub(super) precision: Precision,
    prefix: String,
    list: Vec<Node>,
    count: usize,
    constants: HashMap<Tensor, String>,
}

impl Nodes {
    pub(super) fn new(prefix: &str, precision: Precision) -> Self {
        let (list, constants) = (Vec::new(), HashMap::new());
        Self { precision, prefix: prefix.to_owned(), list, count: 0, constants }
    }

    pub(super) fn finish(self) -> Vec<Node> {
        self.list
    }

    /// A name that no other value has.
    pub(super) fn fresh(&mut self) -> String {
        self.count += 1;
        format!("{}{}", self.prefix, self.count)
    }

    /// Adds a node with named outputs.
    pub(super) fn push(&mut self, kind: &str, inputs: &[&str], outputs: &[&str], attribute: Vec<Attribute>) {
        self.node(kind, None, inputs, outputs, attribute);
    }

    /// Adds a call of a function of the model.
    pub(super) fn call_into(&mut self, function: &str, inputs: &[&str], output: &str) {
        self.node(function, Some(DOMAIN.to_owned()), inputs, &[output], Vec::new());
    }

    fn node(
        &mut self,
        kind: &str,
        domain: Option<String>,
        inputs: &[&str],
        outputs: &[&str],
        attribute: Vec<Attribute>,
    ) {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let (input, output, op_type) = (owned(inputs), owned(outputs), Some(kind.to_owned()));
        self.list.push(Node { input, output, op_type, attribute, domain });
    }

    /// The result of an operator.
    pub(super) fn op(&mut self, kind: &str, inputs: &[&str]) -> String {
        self.op_with(kind, inputs, Vec::new())
    }

    /// The result of an operator with attributes.
    pub(super) fn op_with(&mut self, kind: &str, inputs: &[&str], attributes: Vec<Attribute>) -> String {
        let result = self.fresh();
        self.push(kind, inputs, &[&result], attributes);
        result
    }

    /// The result of a function of the model.
    pub(super) fn call(&mut self, function: &str, inputs: &[&str]) -> String {
        let result = self.fresh();
        self.call_into(function, inputs, &result);
        result
    }

    fn constant(&mut self, tensor: Tensor) -> String {
        if let Some(known) = self.constants.get(&tensor) {
            return known.clone();
        }
        let t = Some(tensor.clone());
        let name = Some(String::from("value"));
        let value = Attribute { name, t, r#type: Some(attribute::TENSOR), ..Attribute::default() };
        let result = self.op_with("Constant", &[], vec![value]);
        self.constants.insert(tensor, result.clone());
        result
    }

    /// Constant whole numbers; a single number if `dims` is empty.
    pub(super) fn integers(&mut self, dims: &[usize], numbers: &[i64]) -> String {
        let raw: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.raw(dims, element::INT64, raw)
    }

    /// A constant vector of whole numbers.
    pub(super) fn sizes(&mut self, numbers: &[usize]) -> String {
        let sizes: Vec<i64> = numbers.iter().map(|&len| size(len)).collect();
        self.integers(&[sizes.len()], &sizes)
    }

    /// Constant numbers in the precision of the model.
    pub(super) fn numbers(&mut self, dims: &[usize], numbers: &[f64]) -> String {
        // Finite numbers stay finite.
        let finite = |number: f64| number.clamp(f64::from(f32::MIN), f64::from(f32::MAX));
        #[expect(clippy::cast_possible_truncation, reason = "to the precision of the model")]
        let narrow = |number: f64| if number.is_infinite() { number as f32 } else { finite(number) as f32 };
        let raw = match self.precision {
            Precision::Double => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            Precision::Float => numbers.iter().flat_map(|&number| narrow(number).to_le_bytes()).collect(),
        };
        self.raw(dims, real(self.precision), raw)
    }

    fn raw(&mut self, dims: &[usize], elements: i32, raw: Vec<u8>) -> String {
        let dims = dims.iter().map(|&len| size(len)).collect();
        self.constant(Tensor { dims, data_type: Some(elements), raw_data: Some(raw) })
    }

    /// Parts of a vector, one after the other.
    pub(super) fn split(&mut self, x: &str, lens: &[usize]) -> Vec<String> {
        let lens_of = self.sizes(lens);
        let parts: Vec<String> = lens.iter().map(|_| self.fresh()).collect();
        let outputs: Vec<&str> = parts.iter().map(String::as_str).collect();
        self.push("Split", &[x, &lens_of], &outputs, vec![integer("axis", 0)]);
        parts
    }

    /// `len` elements of a vector from `start` on.
    pub(super) fn slice(&mut self, x: &str, start: usize, len: usize) -> String {
        let (from, to) = (self.sizes(&[start]), self.sizes(&[start + len]));
        self.op("Slice", &[x, &from, &to])
    }

    pub(super) fn reshape(&mut self, x: &str, dims: &[i64]) -> String {
        let shape = self.integers(&[dims.len()], dims);
        self.op("Reshape", &[x, &shape])
    }

    pub(super) fn concat(&mut self, parts: &[&str]) -> String {
        self.op_with("Concat", parts, vec![integer("axis", 0)])
    }
}
