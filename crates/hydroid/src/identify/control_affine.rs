//! Libraries whose equations are control-affine, so that a control law can invert them.

use hydroid_core::model::sparse::{Factor, Shape, Term};

use crate::sindy::{Library, VariableKind, Variables};

type Form = &'static [Shape];

const IDENTITY: Form = &[Shape::Power(1)];
const SINE: Form = &[Shape::Sin];
const SIGNED_SQUARE: Form = &[Shape::Power(1), Shape::Abs];

/// One library for each combination of functions of the commands: `c` or `c |c|`, for an angle `c` or `sin(c)`, with
/// the terms of all `libraries` that are linear in these. Beyond 16 combinations, the later commands enter linearly.
pub(super) fn libraries(libraries: &[Library], variables: &Variables) -> Vec<Library> {
    const MOST: usize = 16;
    let mut terms: Vec<Term> = Vec::new();
    for library in libraries {
        let fresh: Vec<Term> =
            library.terms(variables).into_iter().filter(|term| !terms.contains(term)).collect();
        terms.extend(fresh);
    }
    let mut choices: Vec<Vec<(u16, Form)>> = vec![Vec::new()];
    for (command, kind) in variables.inputs() {
        let forms: &[Form] = match kind {
            _ if 2 * choices.len() > MOST => &[IDENTITY],
            VariableKind::Plain => &[SIGNED_SQUARE, IDENTITY],
            VariableKind::Angle => &[IDENTITY, SINE],
            VariableKind::Wind => &[IDENTITY],
        };
        choices = choices
            .iter()
            .flat_map(|before| {
                forms.iter().map(move |form| before.iter().copied().chain([(command, *form)]).collect())
            })
            .collect();
    }
    let mut all: Vec<Library> = Vec::new();
    for choice in choices {
        let library =
            Library::listed(terms.iter().filter(|term| is_affine(term, &choice)).cloned().collect());
        if !all.contains(&library) {
            all.push(library);
        }
    }
    all
}

fn is_affine(term: &Term, choice: &[(u16, Form)]) -> bool {
    let of_command = |factor: &&Factor| choice.iter().any(|(command, _)| *command == factor.variable);
    let factors: Vec<&Factor> = term.factors().iter().filter(of_command).collect();
    let Some(first) = factors.first() else { return true };
    choice.iter().any(|(command, form)| {
        *command == first.variable
            && factors.iter().all(|factor| factor.variable == *command)
            && factors.iter().map(|factor| factor.shape).eq(form.iter().copied())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_library_has_one_function_of_each_command() {
        let variables =
            Variables::new(vec![VariableKind::Plain; 3], vec![VariableKind::Plain, VariableKind::Angle]);
        let all = [Library::marine(), Library::polynomial(2)];
        let found = libraries(&all, &variables);
        assert_eq!(found.len(), 4);
        for library in &found {
            let terms = library.terms(&variables);
            let has = |wanted: &Term| terms.contains(wanted);
            let rudder = [Term::monomial(&[4]), Term::of(4, Shape::Sin)];
            assert!(has(&rudder[0]) != has(&rudder[1]), "one of the two");
            let propeller = [Term::monomial(&[3]), Term::signed_square(3, 3)];
            assert!(has(&propeller[0]) != has(&propeller[1]), "one of the two");
            // Drag is kept; products of commands are omitted.
            assert!(has(&Term::signed_square(0, 0)) && has(&Term::monomial(&[0, 1])));
            assert!(!has(&Term::monomial(&[3, 4])) && !has(&Term::signed_square(0, 3)));
        }
        // The last library: the identity of a command, the sine of an angle.
        let last = found.last().unwrap().terms(&variables);
        assert!(last.contains(&Term::monomial(&[3])) && last.contains(&Term::of(4, Shape::Sin)));
    }
}
