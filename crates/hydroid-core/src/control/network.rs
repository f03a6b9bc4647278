//! A control-affine network as a model that a control law can invert.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::affine::{Affine, Motion};
use super::error::ControlError;
use crate::actuator::{Channel, Lag};
use crate::model::affine::{ControlAffine, Field};

/// A [`ControlAffine`] network of `u`, `v` and `r` in the form `d nu/dt = f(nu) + sum_i g_i(nu) phi_i(a_i)`.
#[derive(Clone, Debug)]
pub struct AffineNetwork {
    model: Arc<ControlAffine>,
    field: Field,
    channels: Vec<Channel>,
    scratch: Vec<f64>,
}

impl AffineNetwork {
    /// Of a network whose outputs are `u`, `v` and `r`, in m/s and rad/s.
    ///
    /// # Errors
    /// If it has other outputs, or its parts do not fit together.
    pub fn new(model: Arc<ControlAffine>) -> Result<Self, ControlError> {
        let outputs = model.outputs();
        if outputs != 3 || model.check().is_err() {
            let needed = "a network whose parts fit, of u, v and r, is needed";
            return Err(ControlError::Setting { what: "outputs", value: outputs as f64, needed });
        }
        let field = Field::new(&model);
        let channels = model.effectors.iter().map(|effector| Channel {
            lag: Lag::of_time_constant(effector.time_constant_s),
            map: effector.map,
        });
        Ok(Self { channels: channels.collect(), scratch: vec![0.0; field.scratch()], field, model })
    }
}

impl Affine for AffineNetwork {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        assert_eq!(into.g.len(), self.channels.len(), "one column for each command");
        let scale = &self.model.scaling.correction_scale;
        let given = self.field.evaluate(&self.model, &nu, &mut self.scratch);
        into.f = core::array::from_fn(|j| scale[j] * given[j]);
        for (i, (g, effector)) in into.g.iter_mut().zip(&self.model.effectors).enumerate() {
            *g = core::array::from_fn(|j| scale[j] * given[3 * (1 + i) + j] / effector.unit);
        }
    }
}
