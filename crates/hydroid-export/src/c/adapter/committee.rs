//! Members of a committee that learn, in C.

use std::fmt::Write as _;

use super::least_squares::{self, NOISE};
use super::{Code, Fields, Learning};
use crate::adapter::MemberLearner;

/// Functions of a member.
const MEMBER: &str = include_str!("committee_member.c");

/// Functions of all members.
const RUN: &str = include_str!("committee.c");

fn member_functions(of: &Learning<'_>, member: &MemberLearner) -> String {
    let constants = &member.constants;
    let number = |value: f64| of.number(value);
    MEMBER
        .replace("INCREMENT(", &format!("{}(", of.function(member.increment)))
        .replace("MEMBER", &constants.member.to_string())
        .replace("TERMS", &constants.scales.len().to_string())
        .replace("NEEDED", &format!("{}U", member.needed))
        .replace("STRIDE", &format!("{}U", constants.stride))
        .replace("CLOCK", &number(member.clock_s))
        .replace("ROW", &format!("{}U", constants.row_increments))
        .replace("SHARE", &number(1.0 / constants.row_increments as f64))
        .replace("LONGEST", &format!("{}U", constants.noise.longest))
        .replace("RATE", &number(constants.noise.rate))
        .replace("AVERAGING", &number(constants.averaging as f64))
}

pub(super) fn code(of: &Learning<'_>, members: &[MemberLearner]) -> Code {
    let about = String::from(
        " * Members that learn continue the regression of the training rows by recursive least squares, without forgetting.
 * A row is the mean of increments over a clock step of T seconds:
 *     (y(t + T) - y(t)) / T = Xi theta(z(t))
 * The coefficients Xi are those of ridge regression on all rows so far, in which the training rows have the weight of
 * the prior. An innovation gate reduces the weight of outliers. Increments with a missing value are not part of a row.
",
    );
    let (mut types, mut fields) = (String::from(NOISE), Fields::default());
    let mut source = members
        .first()
        .map_or_else(String::new, |member| least_squares::functions(of, &member.constants.noise));
    let (mut forget_all, mut begin_all, mut learn_all) =
        (String::from("    size_t i;\n"), String::new(), String::new());
    let at = match of.adapter.behind_positions() {
        0 => String::from("state->x"),
        at => format!("state->x + {at}"),
    };
    for member in members {
        let (index, terms) = (member.constants.member, member.constants.scales.len());
        let mut own = Fields::default();
        least_squares::covariance(&mut own, "", terms);
        own.reals("phi", terms, "sum of the scaled terms of the present row");
        own.reals("z", member.outputs, "sum of the rates of the present row");
        own.inner("noise", "NAME_noise", &least_squares::noise(member.outputs));
        own.counter("increments", "in the present row");
        let _ = writeln!(
            types,
            "\n/* Learning of member {index}: {terms} terms in the rates of {} outputs. */\ntypedef struct {{\n{}}} NAME_learner_{index};",
            member.outputs, own.text
        );
        let name = format!("learner_{index}");
        fields.inner(&name, &format!("NAME_{name}"), &own);
        let (tables, body) = least_squares::forget(
            of,
            &member.constants.factor,
            &index.to_string(),
            &format!("adapter->{name}.?"),
        );
        source.push('\n');
        source.push_str(&of.table(&format!("NAME_scale_{index}"), &member.constants.scales));
        source.push_str(&tables);
        source.push_str(&member_functions(of, member));
        forget_all.push_str(&body);
        let _ = writeln!(forget_all, "    NAME_forget_noise(&adapter->{name}.noise);");
        let _ = writeln!(begin_all, "    NAME_forget_row_{index}(&adapter->{name});");
        let first = of.adapter.first_weight() + member.constants.first;
        let _ = writeln!(learn_all, "        outcome = NAME_learn_{index}(&adapter->{name}, {at}, state->x + {first}, adapter->measured);
        result = (outcome == UPPER_WAITING) ? result : outcome;");
    }
    types.push('\n');
    fields.counter("measured", "consecutive samples without a missing value");
    fields.counter("observed", "1: the present sample was measured");
    source.push_str(
        &RUN.replace("FORGET_ALL", &forget_all)
            .replace("BEGIN_ALL", &begin_all)
            .replace("LEARN_ALL", &learn_all),
    );
    Code { about, types, fields, source }
}
