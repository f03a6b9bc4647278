//! Control laws in closed loop on the true plants, and the models that they invert.

mod autopilot;
mod backstepping;
mod candidates;
mod cem;
mod equations;
mod feedback_linearization;
mod helm;
mod learned;
mod written;
