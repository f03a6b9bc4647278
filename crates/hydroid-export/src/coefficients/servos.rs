//! Servos of actuators as data of generated code.

use hydroid_core::craft::Servo;

use super::literal::Literal;

/// Servos in the order of [`hydroid_core::craft::Dynamics`].
#[derive(Default)]
pub(super) struct Servos {
    names: Vec<String>,
    records: Vec<Literal>,
    /// Those that do not follow at once.
    moving: Vec<usize>,
}

impl Servos {
    /// Adds a servo, and returns its index. The steps of an exact one are those of [`Servo::step`]; another one is integrated
    /// with the equations of motion.
    pub(super) fn add(&mut self, name: &str, servo: &Servo, exact: bool) -> usize {
        let index = self.records.len();
        let Servo { order, lag, rate } = servo;
        let each =
            |of: &dyn Fn(&(usize, f64, f64)) -> Literal| Literal::Row(order.terms.iter().map(of).collect());
        self.records.push(Literal::Record(vec![
            ("commands", each(&|term| Literal::Index(Some(term.0)))),
            ("neutral", each(&|term| Literal::Number(term.1))),
            ("gain", each(&|term| Literal::Number(term.2))),
            ("low", Literal::Number(order.limits[0])),
            ("high", Literal::Number(order.limits[1])),
            ("lag", Literal::Number(*lag)),
            ("rate", Literal::Number(rate.unwrap_or(f64::INFINITY))),
            ("exact", Literal::Flag(exact)),
        ]));
        if !servo.follows_at_once() {
            self.moving.push(index);
        }
        self.names.push(name.to_owned());
        index
    }

    /// Adds the servos to the data, and describes the positions of the moving ones line by line.
    pub(super) fn describe(self, data: &mut Vec<(&'static str, Literal)>) -> Vec<String> {
        let named = |(k, index): (usize, &usize)| format!("a({}) {}", k + 1, self.names[*index]);
        let lines = self.moving.iter().enumerate().map(named).collect();
        data.push((
            "MOVING",
            Literal::Row(self.moving.iter().map(|index| Literal::Index(Some(*index))).collect()),
        ));
        data.push(("SERVOS", Literal::List(self.records)));
        lines
    }
}
