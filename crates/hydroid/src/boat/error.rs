//! Errors of the description of a boat.

use super::Role;

/// Wrong description of a boat.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum BoatError {
    #[error(
        "a role is stated of '{name}', and there is no such input{}; the inputs are {known}",
        nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default()
    )]
    UnknownInput { name: String, nearest: Option<String>, known: String },
    #[error("two roles are stated of '{name}', {} and {}: leave one", roles[0], roles[1])]
    TwoRoles { name: String, roles: [Role; 2] },
    #[error("'{0}' is not INPUT=ROLE, as in delta=steering")]
    NoRole(String),
    #[error("'{0}' is not a role: write propulsion, steering, thruster, disturbance or setting")]
    UnknownRole(String),
}
