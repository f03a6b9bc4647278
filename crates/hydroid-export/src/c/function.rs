//! The body of a function in C.
//!
//! A node of one number that is used once becomes a part of the expression that uses it; other nodes become variables. A node
//! of several numbers that is computed element by element and used once is computed in the loop that uses it.

use std::fmt::Write as _;

use super::number::Precision;
use crate::graph::{Binary, Cell, Function, Id, Matrix, Module, Op, Test, Unary};

/// Deepest nesting of an expression.
const DEEPEST: usize = 12;

/// Longest line of an expression that is not broken.
const LINE: usize = 100;

pub(super) struct Printer<'a> {
    pub(super) prefix: &'a str,
    pub(super) precision: Precision,
    pub(super) module: &'a Module,
}

/// A function while it is printed.
struct Body<'a> {
    printer: &'a Printer<'a>,
    function: &'a Function,
    uses: Vec<usize>,
    depth: Vec<usize>,
    /// Whether a node is a part of the expression that uses it.
    inline: Vec<bool>,
    text: String,
    /// Tables of constants, in front of the function.
    tables: String,
}

impl Printer<'_> {
    /// Name of a function.
    pub(super) fn name(&self, index: usize) -> String {
        format!("{}_f{index}_{}", self.prefix, self.module.functions[index].name)
    }

    /// A function with its tables of constants.
    pub(super) fn function(&self, index: usize) -> String {
        let function = &self.module.functions[index];
        let mut body = Body {
            printer: self,
            function,
            uses: function.uses(),
            depth: vec![0; function.nodes.len()],
            inline: vec![false; function.nodes.len()],
            text: String::new(),
            tables: String::new(),
        };
        body.choose();
        for id in 0..function.nodes.len() {
            body.node(id, index);
        }
        body.result();
        let real = self.precision.type_name();
        let arguments = function.arguments.iter().filter(|argument| argument.len > 0);
        let mut arguments: Vec<String> =
            arguments.map(|argument| format!("const {real} {}[{}]", argument.name, argument.len)).collect();
        arguments.push(format!("{real} result[{}]", function.len()));
        let (tables, text) = (body.tables, body.text);
        format!(
            "{tables}/* {}. */\nstatic void {}({})\n{{\n{text}}}\n",
            function.about,
            self.name(index),
            arguments.join(", ")
        )
    }
}

/// Whether a node is computed element by element.
fn element_wise(op: &Op) -> bool {
    matches!(op, Op::Unary(..) | Op::Binary(..) | Op::Select { .. })
}

impl Body<'_> {
    fn op(&self, id: Id) -> &Op {
        &self.function.nodes[id].op
    }

    fn len(&self, id: Id) -> usize {
        self.function.nodes[id].len
    }

    /// Chooses the nodes that are parts of expressions.
    fn choose(&mut self) {
        let nodes = &self.function.nodes;
        let mut user: Vec<Option<Id>> = vec![None; nodes.len()];
        for (id, node) in nodes.iter().enumerate() {
            node.op.operands().into_iter().for_each(|operand| user[operand] = Some(id));
        }
        for (id, node) in nodes.iter().enumerate() {
            let nested =
                node.op.operands().into_iter().filter(|&of| self.inline[of]).map(|of| self.depth[of]);
            let depth = nested.max().map_or(0, |depth| depth + 1);
            // A number in a loop over elements is computed once, in front of it.
            let joins = user[id].is_some_and(|user| match &nodes[user].op {
                Op::Concat(_) => true,
                op => element_wise(op) && nodes[user].len == node.len,
            });
            self.inline[id] = element_wise(&node.op) && self.uses[id] == 1 && joins && depth < DEEPEST;
            self.depth[id] = if self.inline[id] { depth } else { 0 };
        }
    }

    fn literal(&self, value: f64) -> String {
        self.printer.precision.literal(value)
    }

    /// Name of an array, or the address of a number.
    fn array(&self, id: Id) -> String {
        match self.op(id) {
            Op::Argument(index) => self.function.arguments[*index].name.to_owned(),
            Op::Slice { of, start } if self.len(*of) > 1 => match start {
                0 => self.array(*of),
                start => format!("{} + {start}", self.array(*of)),
            },
            Op::Slice { of, .. } => self.array(*of),
            Op::Constant(_) => format!("k{id}"),
            _ if self.len(id) == 1 && element_wise(self.op(id)) => format!("&t{id}"),
            _ => self.variable(id),
        }
    }

    /// Whether a node is computed in the place of the result.
    fn in_place(&self, id: Id) -> bool {
        let op = self.op(id);
        let computed = !matches!(op, Op::Argument(_) | Op::Slice { .. } | Op::Constant(_));
        id == self.function.result && computed && (self.len(id) > 1 || !element_wise(op))
    }

    /// Name of the array of a node.
    fn variable(&self, id: Id) -> String {
        if self.in_place(id) { String::from("result") } else { format!("t{id}") }
    }

    /// Declares the array of a node, and gives its name.
    fn declare(&mut self, id: Id) -> String {
        let (real, len) = (self.printer.precision.type_name(), self.len(id));
        if !self.in_place(id) {
            self.line(&format!("{real} t{id}[{len}];"));
        }
        self.variable(id)
    }

    /// The element `i` of a node as an expression of high precedence; `i` is a number or a variable.
    fn element(&self, id: Id, i: &str) -> String {
        let i = if self.len(id) == 1 { "0" } else { i };
        match self.op(id) {
            Op::Constant(numbers) if numbers.len() == 1 => self.literal(numbers[0]),
            Op::Argument(index) => format!("{}[{i}]", self.function.arguments[*index].name),
            Op::Slice { of, start } => {
                let place = match (i.parse::<usize>(), *start) {
                    (Ok(i), start) => (start + i).to_string(),
                    (Err(_), 0) => i.to_owned(),
                    (Err(_), start) => format!("{start} + {i}"),
                };
                self.element(*of, &place)
            }
            _ if self.inline[id] && self.is_call(id) => self.expression(id, i),
            _ if self.inline[id] => format!("({})", self.expression(id, i)),
            op if self.len(id) == 1 && element_wise(op) => format!("t{id}"),
            Op::Constant(_) => format!("k{id}[{i}]"),
            _ => format!("{}[{i}]", self.variable(id)),
        }
    }

    /// The element `i` of a node as an expression, without parentheses around it.
    fn expression(&self, id: Id, i: &str) -> String {
        let printer = self.printer;
        match self.op(id) {
            Op::Unary(Unary::Neg, x) => {
                printer.precision.unary(printer.prefix, Unary::Neg, &self.element(*x, i))
            }
            Op::Unary(f, x) => printer.precision.unary(printer.prefix, *f, &self.whole(*x, i)),
            Op::Binary(f, a, b) => {
                let (left, right) = (self.element(*a, i), self.element(*b, i));
                // A sum or a product of which this continues the left side needs no parentheses.
                let continues = |of: Id| match (self.op(of), f) {
                    (Op::Binary(Binary::Add | Binary::Sub, ..), Binary::Add | Binary::Sub)
                    | (Op::Binary(Binary::Mul | Binary::Div, ..), _) => self.inline[of],
                    _ => false,
                };
                let left = if continues(*a) { self.expression(*a, i) } else { left };
                let product =
                    matches!(self.op(*b), Op::Binary(Binary::Mul | Binary::Div, ..)) && self.inline[*b];
                let right = match f {
                    Binary::Add | Binary::Sub if product => self.expression(*b, i),
                    _ => right,
                };
                match f {
                    Binary::Add => format!("{left} + {right}"),
                    Binary::Sub => format!("{left} - {right}"),
                    Binary::Mul => format!("{left} * {right}"),
                    Binary::Div => format!("{left} / {right}"),
                    Binary::Min | Binary::Max => {
                        let name = if *f == Binary::Min { "fmin" } else { "fmax" };
                        let both = format!("{}, {}", self.whole(*a, i), self.whole(*b, i));
                        printer.precision.call(name, &both)
                    }
                }
            }
            Op::Select { test, a, b, then, otherwise } => {
                let [a, b, then, otherwise] = [a, b, then, otherwise].map(|id| self.element(*id, i));
                match test {
                    Test::Less => format!("({a} < {b}) ? {then} : {otherwise}"),
                    Test::LessOrEqual => format!("({a} <= {b}) ? {then} : {otherwise}"),
                    Test::IsNumber => format!("isnan({a}) ? {otherwise} : {then}"),
                }
            }
            _ => self.element(id, i),
        }
    }

    /// The element `i` of a node between commas or parentheses.
    fn whole(&self, id: Id, i: &str) -> String {
        if self.inline[id] { self.expression(id, i) } else { self.element(id, i) }
    }

    /// Whether a node is a call of a function in C.
    fn is_call(&self, id: Id) -> bool {
        match self.op(id) {
            Op::Unary(f, _) => *f != Unary::Neg,
            Op::Binary(f, ..) => matches!(f, Binary::Min | Binary::Max),
            _ => false,
        }
    }

    fn line(&mut self, line: &str) {
        let _ = writeln!(self.text, "    {line}");
    }

    /// A statement that may be long: it is broken in front of signs outside of all parentheses.
    fn statement(&mut self, start: &str, expression: &str) {
        let (mut depth, mut column) = (0_i32, start.len());
        let mut text = format!("    {start}");
        for (at, c) in expression.char_indices() {
            depth += i32::from(c == '(') - i32::from(c == ')');
            let rest = &expression[at..];
            let sign = rest.starts_with(" + ") || rest.starts_with(" - ");
            if depth == 0 && sign && column > LINE {
                text.push_str("\n       ");
                column = 0;
            }
            text.push(c);
            column += 1;
        }
        let _ = writeln!(self.text, "{text};");
    }

    /// A loop over the elements of a vector.
    fn each(&mut self, len: usize, body: &str) {
        self.line(&format!("for (i = 0; i < {len}; ++i) {{"));
        self.line(&format!("    {body}"));
        self.line("}");
    }

    fn node(&mut self, id: Id, index: usize) {
        let (real, len) = (self.printer.precision.type_name(), self.len(id));
        if self.inline[id] || len == 0 {
            return;
        }
        let function = self.function;
        match &function.nodes[id].op {
            Op::Argument(_) | Op::Slice { .. } => {}
            Op::Constant(numbers) => {
                if len > 1 || self.is_address(id) {
                    self.table(&format!("k{id}"), &format!("{index}"), numbers);
                }
            }
            Op::Unary(..) | Op::Binary(..) | Op::Select { .. } if len == 1 => {
                let expression = self.expression(id, "0");
                self.statement(&format!("const {real} t{id} = "), &expression);
            }
            Op::Unary(..) | Op::Binary(..) | Op::Select { .. } => {
                let expression = self.expression(id, "i");
                let t = self.declare(id);
                self.each(len, &format!("{t}[i] = {expression};"));
            }
            Op::Concat(parts) => {
                let t = self.declare(id);
                self.concat(&t, parts);
            }
            Op::Affine { weights, bias, x } => {
                let t = self.declare(id);
                self.affine(&t, &format!("t{id}"), index, weights, bias, *x);
            }
            Op::Product { matrix, x } => {
                let columns = self.len(*x);
                self.helper("product", id, (*matrix, *x), &format!("{len}, {columns}"));
            }
            Op::TransposedProduct { matrix, x } => {
                let rows = self.len(*x);
                self.helper("transposed_product", id, (*matrix, *x), &format!("{rows}, {len}"));
            }
            Op::Outer { a, b } => {
                let sizes = format!("{}, {}", self.len(*a), self.len(*b));
                self.helper("outer", id, (*a, *b), &sizes);
            }
            Op::Median { values, votes } => self.median(id, index, values, votes),
            Op::Call { function, arguments } => {
                let t = self.declare(id);
                let call = self.call(*function, arguments, &[], &t);
                self.line(&call);
            }
            Op::Repeat { function, times, arguments } => {
                let t = self.declare(id);
                self.line(&format!("{real} n{id}[{len}];"));
                let from = self.element(arguments[0], "i");
                self.each(len, &format!("{t}[i] = {from};"));
                let call = self.call(*function, &arguments[1..], std::slice::from_ref(&t), &format!("n{id}"));
                self.line(&format!("for (k = 0; k < {times}; ++k) {{"));
                self.line(&format!("    {call}"));
                self.line(&format!("    for (i = 0; i < {len}; ++i) {{"));
                self.line(&format!("        {t}[i] = n{id}[i];"));
                self.line("    }");
                self.line("}");
            }
            Op::Gru { cell, x, h } => {
                self.gates(id, index, cell, *x, *h);
                let t = self.declare(id);
                let (prefix, h) = (self.printer.prefix, self.array(*h));
                self.line(&format!("{prefix}_gru(a{id}, b{id}, {h}, {len}, {t});"));
            }
            Op::Lstm { cell, x, c, h } => {
                self.gates(id, index, cell, *x, *h);
                let t = self.declare(id);
                let (prefix, c) = (self.printer.prefix, self.array(*c));
                self.line(&format!("{prefix}_lstm(a{id}, b{id}, {c}, {}, {t});", len / 2));
            }
        }
    }

    /// A call of a function of `helpers` with two arrays, their sizes, and the array of a node.
    fn helper(&mut self, name: &str, id: Id, (a, b): (Id, Id), sizes: &str) {
        let t = self.declare(id);
        let (prefix, a, b) = (self.printer.prefix, self.array(a), self.array(b));
        self.line(&format!("{prefix}_{name}({a}, {b}, {sizes}, {t});"));
    }

    /// Whether a constant number is passed to a function or read as an array.
    fn is_address(&self, id: Id) -> bool {
        let reads = |op: &Op| match op {
            Op::Call { arguments, .. } | Op::Repeat { arguments, .. } => arguments.contains(&id),
            Op::Affine { x, .. } => *x == id,
            Op::Product { matrix: a, x: b }
            | Op::TransposedProduct { matrix: a, x: b }
            | Op::Outer { a, b } => [*a, *b].contains(&id),
            Op::Gru { x, h, .. } => [*x, *h].contains(&id),
            Op::Lstm { x, c, h, .. } => [*x, *c, *h].contains(&id),
            _ => false,
        };
        self.function.nodes.iter().any(|node| reads(&node.op))
    }

    fn call(&self, function: usize, arguments: &[Id], first: &[String], result: &str) -> String {
        let given = arguments.iter().filter(|&&id| self.len(id) > 0).map(|&id| self.array(id));
        let mut given: Vec<String> = first.iter().cloned().chain(given).collect();
        given.push(result.to_owned());
        format!("{}({});", self.printer.name(function), given.join(", "))
    }

    fn concat(&mut self, into: &str, parts: &[Id]) {
        let mut place = 0;
        for &part in parts {
            let len = self.len(part);
            let part_of = |i: &str| self.whole(part, i);
            if len == 1 {
                let expression = part_of("0");
                self.statement(&format!("{into}[{place}] = "), &expression);
            } else {
                let expression = part_of("i");
                let at = if place == 0 { String::from("i") } else { format!("{place} + i") };
                self.each(len, &format!("{into}[{at}] = {expression};"));
            }
            place += len;
        }
    }

    /// A table of constants; its name is unique in the file by the index of the function.
    fn table(&mut self, name: &str, index: &str, numbers: &[f64]) {
        let (real, prefix) = (self.printer.precision.type_name(), self.printer.prefix);
        let mut text = format!("static const {real} {prefix}_{name}_{index}[{}] = {{", numbers.len());
        for (i, number) in numbers.iter().enumerate() {
            text.push_str(if i % 6 == 0 { "\n    " } else { " " });
            let literal = self.literal(*number);
            text.push_str(literal.trim_matches(['(', ')']));
            text.push(',');
        }
        self.tables.push_str(&text);
        self.tables.push_str("\n};\n");
        if name.starts_with('k') {
            self.line(&format!("const {real} *const {name} = {prefix}_{name}_{index};"));
        }
    }

    /// Matrices are stored column by column: the loop over the rows of a column has no sum, and compilers vectorize it.
    fn affine(&mut self, into: &str, name: &str, index: usize, weights: &Matrix, bias: &[f64], x: Id) {
        let (rows, columns) = (weights.rows, weights.columns);
        let transposed: Vec<f64> =
            (0..columns).flat_map(|j| (0..rows).map(move |i| weights.numbers[i * columns + j])).collect();
        let (w, b) = (format!("w_{name}"), format!("b_{name}"));
        self.table(&w, &index.to_string(), &transposed);
        self.table(&b, &index.to_string(), bias);
        let (prefix, x) = (self.printer.prefix, self.array(x));
        self.line(&format!(
            "{prefix}_affine({prefix}_{w}_{index}, {prefix}_{b}_{index}, {x}, {rows}, {columns}, {into});"
        ));
    }

    fn gates(&mut self, id: Id, index: usize, cell: &Cell, x: Id, h: Id) {
        let (real, rows) = (self.printer.precision.type_name(), cell.weight_ih.rows);
        self.line(&format!("{real} a{id}[{rows}];"));
        self.line(&format!("{real} b{id}[{rows}];"));
        let (a, b) = (format!("a{id}"), format!("b{id}"));
        self.affine(&a, &a, index, &cell.weight_ih, &cell.bias_ih, x);
        self.affine(&b, &b, index, &cell.weight_hh, &cell.bias_hh, h);
    }

    fn median(&mut self, id: Id, index: usize, values: &[Id], votes: &[u32]) {
        let (real, len, count) = (self.printer.precision.type_name(), self.len(id), values.len());
        let (prefix, name) = (self.printer.prefix, format!("votes{id}"));
        let list: Vec<String> = votes.iter().map(u32::to_string).collect();
        let _ = writeln!(
            self.tables,
            "static const unsigned long {prefix}_{name}_{index}[{count}] = {{ {} }};",
            list.join(", ")
        );
        let t = self.declare(id);
        self.line(&format!("for (i = 0; i < {len}; ++i) {{"));
        self.line(&format!("    {real} values[{count}];"));
        self.line(&format!("    unsigned long votes[{count}];"));
        for (k, &value) in values.iter().enumerate() {
            let value = self.element(value, "i");
            self.line(&format!("    values[{k}] = {value};"));
        }
        self.line(&format!("    for (k = 0; k < {count}; ++k) {{"));
        self.line(&format!("        votes[k] = {prefix}_{name}_{index}[k];"));
        self.line("    }");
        self.line(&format!("    {t}[i] = {prefix}_median(values, votes, {count});"));
        self.line("}");
    }

    /// Writes the result, declares the counters, and mentions arguments without use.
    fn result(&mut self) {
        let (id, len) = (self.function.result, self.function.len());
        if self.in_place(id) {
            // The node wrote it.
        } else if len == 1 {
            let expression = self.element(id, "0");
            self.line(&format!("result[0] = {expression};"));
        } else {
            let expression = self.element(id, "i");
            self.each(len, &format!("result[i] = {expression};"));
        }
        for (index, argument) in self.function.arguments.iter().enumerate() {
            let used = self.function.nodes.iter().any(|node| node.op == Op::Argument(index));
            if argument.len > 0 && !used {
                self.line(&format!("(void){};", argument.name));
            }
        }
        let counters: Vec<&str> =
            ["i", "k"].into_iter().filter(|c| self.text.contains(&format!("for ({c} = 0"))).collect();
        if !counters.is_empty() {
            self.text.insert_str(0, &format!("    size_t {};\n", counters.join(", ")));
        }
    }
}
