//! A message type as a flat list of steps: numbers into columns, bytes to skip, sequences to repeat.

use std::cell::Cell;
use std::rc::Rc;

use super::schema::{Count, Member, RosNumber, Schema, Type};
use crate::LONGEST_ARRAY;
use crate::sink::Field;

/// Fields of a topic.
const MOST_FIELDS: usize = 4096;

/// Types within types.
const DEEPEST: usize = 32;

/// Memory of a member of a type with its name, about.
const MEMBER: usize = size_of::<Member>() + 64;

/// Memory of all definitions and plans of a file, in bytes: it falls with each part, and what does not fit is left out.
pub(crate) type Budget = Rc<Cell<usize>>;

/// Takes a part of the budget.
pub(crate) fn spend(budget: &Budget, bytes: usize) -> Result<(), String> {
    let left = budget.get().checked_sub(bytes).ok_or("the definitions of the file are too big")?;
    budget.set(left);
    Ok(())
}

/// A step of decoding.
#[derive(Clone, Copy, Debug)]
pub(super) enum Op {
    /// Numbers into consecutive columns.
    Numbers { kind: RosNumber, count: u32, column: u32 },
    /// Numbers that are left out.
    Skip { kind: RosNumber, count: u32 },
    /// A text whose first value is kept.
    Text { slot: u32 },
    /// Texts that are left out.
    SkipTexts { count: u32 },
    /// The stamp of the header: seconds, with a sign or without, and nanoseconds.
    Stamp { signed: bool },
    /// A sequence, by its index.
    Sequence(u32),
    /// An array of structs that is left out, by the block of an element.
    Loop { block: u32, count: u32 },
    /// The size that XCDR2 writes before arrays and sequences of structs and texts.
    Delimiter,
    /// Nothing behind this place can be read.
    Stop,
}

/// A sequence at one place of the message.
#[derive(Debug)]
pub(super) struct Sequence {
    path: String,
    element: Member,
    /// Name of the struct in which the type of the element is written.
    scope: String,
    depth: usize,
    /// Kind of the elements if they are numbers.
    pub(super) number: Option<RosNumber>,
    /// Steps of the elements that have fields.
    pub(super) elements: Vec<u32>,
    /// Steps over an element that is left out.
    pub(super) skip: u32,
    /// Least bytes of an element.
    pub(super) smallest: u64,
    /// Whether further elements become fields.
    pub(super) growing: bool,
    /// Whether a note says that the sequence is too long.
    told: bool,
}

/// A text field.
#[derive(Debug)]
pub(super) struct Slot {
    pub(super) name: String,
    pub(super) filled: bool,
}

/// Decoding of a message type. Blocks are lists of steps; block 0 is the message.
#[derive(Debug)]
pub(super) struct Plan {
    schema: Rc<Schema>,
    budget: Budget,
    pub(super) blocks: Vec<Vec<Op>>,
    pub(super) sequences: Vec<Sequence>,
    pub(super) fields: Vec<Field>,
    pub(super) slots: Vec<Slot>,
    pub(super) has_stamp: bool,
    /// Elements of arrays and sequences that the message may still have.
    pub(super) elements: usize,
    /// What is left out, since the last look.
    pub(super) notes: Vec<String>,
}

impl Plan {
    pub(super) fn new(schema: Schema, budget: Budget) -> Result<Self, String> {
        for (name, members) in &schema.types {
            spend(&budget, name.len() + members.len() * MEMBER)?;
        }
        let mut plan = Self {
            schema: Rc::new(schema),
            budget,
            blocks: vec![Vec::new()],
            sequences: Vec::new(),
            fields: Vec::new(),
            slots: Vec::new(),
            has_stamp: false,
            elements: 0,
            notes: Vec::new(),
        };
        let root = plan.schema.root.clone();
        if !plan.schema.types.contains_key(&root) {
            return Err(format!("its definition does not contain the type {root}"));
        }
        let mut ops = Vec::new();
        plan.structure(&mut ops, &root, "", true, 0)?;
        plan.blocks[0] = ops;
        Ok(plan)
    }

    /// Whether later messages can have more fields.
    pub(super) fn grows(&self) -> bool {
        self.sequences.iter().any(|sequence| sequence.growing && sequence.element.of != Type::Text)
    }

    /// Adds the fields of one more element of a sequence.
    pub(super) fn grow(&mut self, index: usize) {
        let sequence = &self.sequences[index];
        let number = sequence.elements.len();
        let (element, scope, depth) = (sequence.element.clone(), sequence.scope.clone(), sequence.depth);
        let path = format!("{}[{number}]", sequence.path);
        let mut ops = Vec::new();
        match self.member(&mut ops, &scope, &element, &path, true, depth) {
            Ok(()) if number < LONGEST_ARRAY => {
                let block = self.block(ops);
                self.sequences[index].elements.push(block);
            }
            Ok(()) => self.sequences[index].growing = false,
            Err(reason) => {
                self.sequences[index].growing = false;
                self.note(format!("elements of {path} are left out: {reason}"));
            }
        }
        if self.sequences[index].elements.len() == LONGEST_ARRAY {
            self.sequences[index].growing = false;
        }
    }

    /// States that a sequence is too long.
    pub(super) fn too_long(&mut self, index: usize) {
        let sequence = &mut self.sequences[index];
        if !sequence.told && !sequence.path.is_empty() {
            sequence.told = true;
            let note = left_out(&sequence.path);
            self.note(note);
        }
    }

    fn note(&mut self, note: String) {
        if self.notes.len() < 8 && !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn block(&mut self, ops: Vec<Op>) -> u32 {
        self.blocks.push(ops);
        u32::try_from(self.blocks.len() - 1).expect("the budget ends before 2^32 blocks")
    }

    /// Steps of a struct. Fields are given if `visible`.
    fn structure(
        &mut self,
        ops: &mut Vec<Op>,
        name: &str,
        path: &str,
        visible: bool,
        depth: usize,
    ) -> Result<(), String> {
        if depth > DEEPEST {
            return Err("its types are nested too deep".to_owned());
        }
        let schema = Rc::clone(&self.schema);
        let members = schema.types.get(name).map_or(&[][..], Vec::as_slice);
        if members.is_empty() && !schema.ros1 {
            // ROS 2 gives an empty struct one byte, because IDL has no empty structs.
            self.push(ops, Op::Skip { kind: RosNumber::U8, count: 1 })?;
        }
        for member in members {
            let inner = match (path.is_empty(), member.name.is_empty()) {
                (true, _) => member.name.clone(),
                (_, true) => path.to_owned(),
                _ => format!("{path}.{}", member.name),
            };
            let is_header = depth == 1 && path == "header" && name == "std_msgs/Header";
            if is_header && member.name == "stamp" {
                self.has_stamp = true;
                self.push(ops, Op::Stamp { signed: !schema.ros1 })?;
            } else {
                self.member(ops, name, member, &inner, visible, depth)?;
            }
            if matches!(ops.last(), Some(Op::Stop)) {
                break;
            }
        }
        Ok(())
    }

    fn member(
        &mut self,
        ops: &mut Vec<Op>,
        scope: &str,
        member: &Member,
        path: &str,
        visible: bool,
        depth: usize,
    ) -> Result<(), String> {
        // Members of empty structs cost time too.
        spend(&self.budget, 8)?;
        let (of, scope) = self.settle(&member.of, scope)?;
        let count = match member.count {
            Count::Any => return self.new_sequence(ops, of, scope, path, visible, depth),
            Count::One => 1,
            Count::Fixed(0) => return Ok(()),
            Count::Fixed(count) => count,
        };
        let is_array = member.count != Count::One;
        let fits = count as usize <= LONGEST_ARRAY;
        if visible && !fits {
            self.note(left_out(path));
        }
        let visible = visible && fits;
        let element = |i: u32| if is_array { format!("{path}[{i}]") } else { path.to_owned() };
        if is_array && !matches!(of, Type::Number(_)) {
            self.push(ops, Op::Delimiter)?;
        }
        match of {
            Type::Number(kind) => {
                for i in 0..if visible { count } else { 0 } {
                    let op = match self.field(element(i)) {
                        Some(column) => Op::Numbers { kind, count: 1, column },
                        None => Op::Skip { kind, count: 1 },
                    };
                    self.push(ops, op)?;
                }
                if !visible {
                    self.push(ops, Op::Skip { kind, count })?;
                }
            }
            Type::Text if visible => {
                for i in 0..count {
                    let op = match self.slot(element(i)) {
                        Some(slot) => Op::Text { slot },
                        None => Op::SkipTexts { count: 1 },
                    };
                    self.push(ops, op)?;
                }
            }
            Type::Text => self.push(ops, Op::SkipTexts { count })?,
            Type::Unreadable(name) => {
                self.note(format!("{path} and all behind it are left out: {name} cannot be decoded"));
                self.push(ops, Op::Stop)?;
            }
            Type::Named(name) if visible || !is_array => {
                for i in 0..count {
                    self.structure(ops, &name, &element(i), visible, depth + 1)?;
                    if matches!(ops.last(), Some(Op::Stop)) {
                        break;
                    }
                }
            }
            Type::Named(name) => {
                let mut inner = Vec::new();
                self.structure(&mut inner, &name, "", false, depth + 1)?;
                if !inner.is_empty() {
                    let block = self.block(inner);
                    self.push(ops, Op::Loop { block, count })?;
                }
            }
        }
        Ok(())
    }

    fn new_sequence(
        &mut self,
        ops: &mut Vec<Op>,
        of: Type,
        scope: String,
        path: &str,
        visible: bool,
        depth: usize,
    ) -> Result<(), String> {
        if depth > DEEPEST {
            return Err("its types are nested too deep".to_owned());
        }
        let number = if let Type::Number(kind) = of { Some(kind) } else { None };
        if number.is_none() {
            self.push(ops, Op::Delimiter)?;
        }
        let element = Member { name: String::new(), of, count: Count::One };
        let mut inner = Vec::new();
        self.member(&mut inner, &scope, &element, "", false, depth)?;
        let smallest = inner.iter().fold(0, |sum: u64, op| sum.saturating_add(self.least(op)));
        let skip = self.block(inner);
        spend(&self.budget, size_of::<Sequence>() + path.len() + scope.len())?;
        self.sequences.push(Sequence {
            path: if visible { path.to_owned() } else { String::new() },
            element,
            scope,
            depth,
            number,
            elements: Vec::new(),
            skip,
            smallest,
            growing: visible,
            told: false,
        });
        let index = u32::try_from(self.sequences.len() - 1).map_err(|_| "its types are too big")?;
        self.push(ops, Op::Sequence(index))
    }

    /// Least bytes of a step.
    fn least(&self, op: &Op) -> u64 {
        match *op {
            Op::Numbers { kind, count, .. } | Op::Skip { kind, count } => {
                kind.size() as u64 * u64::from(count)
            }
            Op::Text { .. } | Op::Sequence(_) => 4,
            Op::SkipTexts { count } => 4 * u64::from(count),
            Op::Stamp { .. } => 8,
            Op::Loop { block, count } => {
                let block = &self.blocks[block as usize];
                let sum = block.iter().fold(0, |sum: u64, op| sum.saturating_add(self.least(op)));
                sum.saturating_mul(u64::from(count))
            }
            Op::Delimiter | Op::Stop => 0,
        }
    }

    /// The type itself: names are full names, and a name for a number or a text is that number or text.
    fn settle(&self, of: &Type, scope: &str) -> Result<(Type, String), String> {
        let mut of = of.clone();
        let mut scope = scope.to_owned();
        for _ in 0..DEEPEST {
            let Type::Named(name) = &of else { return Ok((of, scope)) };
            let Some(full) = self.schema.resolve(name, &scope) else {
                return Err(format!("its definition does not contain the type {name}"));
            };
            let full = full.to_owned();
            match self.schema.types.get(&full).map(Vec::as_slice) {
                Some([only]) if only.name.is_empty() && only.count == Count::One => {
                    of = only.of.clone();
                    scope = full;
                }
                _ => return Ok((Type::Named(full.clone()), full)),
            }
        }
        Err("its types are nested too deep".to_owned())
    }

    fn field(&mut self, name: String) -> Option<u32> {
        let size = name.len() + size_of::<Field>();
        if self.fields.len() >= MOST_FIELDS || spend(&self.budget, size).is_err() {
            self.note(format!("{name} and all fields behind it are left out: there are too many"));
            return None;
        }
        self.fields.push(Field { name, unit: None });
        u32::try_from(self.fields.len() - 1).ok()
    }

    fn slot(&mut self, name: String) -> Option<u32> {
        if self.slots.len() >= MOST_FIELDS || spend(&self.budget, name.len() + size_of::<Slot>()).is_err() {
            return None;
        }
        self.slots.push(Slot { name, filled: false });
        u32::try_from(self.slots.len() - 1).ok()
    }

    /// Adds a step, or extends the one before.
    fn push(&mut self, ops: &mut Vec<Op>, op: Op) -> Result<(), String> {
        match (ops.last_mut(), op) {
            (Some(Op::Numbers { kind, count, column }), Op::Numbers { kind: next, count: 1, column: at })
                if *kind == next && *column + *count == at =>
            {
                *count += 1;
                return Ok(());
            }
            (Some(Op::Skip { kind, count }), Op::Skip { kind: next, count: more }) if *kind == next => {
                if let Some(sum) = count.checked_add(more) {
                    *count = sum;
                    return Ok(());
                }
            }
            _ => {}
        }
        spend(&self.budget, size_of::<Op>())?;
        ops.push(op);
        Ok(())
    }
}

fn left_out(path: &str) -> String {
    format!("{path} has more than {LONGEST_ARRAY} elements and is left out")
}
