//! Model exchange: states, their derivatives, and derivatives in a direction.

use hydroid_export::fmu::{Directional, Role, Variable};

use crate::instance::{Instance, Kind, Outcome, Phase, finite};

impl Instance {
    /// Derivatives of the states, with those in the direction of a seed of states and inputs.
    fn rates(&self, seed: Option<(&[f64], &[f64])>) -> Outcome<Vec<Directional>> {
        let continuous = self.resource.variables.continuous()?;
        let along = |values: &[f64], seed: Option<&[f64]>| -> Vec<Directional> {
            let slope = |i: usize| seed.map_or(0.0, |seed| seed[i]);
            values.iter().enumerate().map(|(i, &value)| Directional::along(value, 0, slope(i))).collect()
        };
        let x = along(&self.present, seed.map(|seed| seed.0));
        let c = along(&self.inputs, seed.map(|seed| seed.1));
        let mut rates = x.clone();
        continuous.rates(&x, &c, self.current, &mut rates);
        Ok(rates)
    }

    /// Derivative of variables in the direction of a seed of inputs and states.
    pub(crate) fn directional(&self, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> Outcome<Vec<f64>> {
        if self.kind() == Kind::CoSimulation {
            return Err(String::from("directional derivatives are those of model exchange"));
        }
        self.need("a directional derivative", &[Phase::Event, Phase::Continuous])?;
        let (mut states, mut inputs) = (vec![0.0; self.present.len()], vec![0.0; self.inputs.len()]);
        for (reference, seed) in knowns.iter().zip(seed) {
            let Variable { role, name, .. } = self.variable(*reference)?;
            let place = match (*role, self.state_index(*role)) {
                (Role::Input(i), _) => &mut inputs[i],
                (_, Some(index)) => &mut states[index],
                _ => return Err(format!("{name} is neither an input nor a state")),
            };
            *place += seed;
        }
        let rates = self.rates(Some((&states, &inputs)))?;
        let sensitivity = |reference: &u32| {
            let Variable { role, name, .. } = self.variable(*reference)?;
            match (*role, self.state_index(*role)) {
                (Role::Derivative(index), _) => Ok(rates[index].partials[0]),
                (_, Some(index)) => Ok(states[index]),
                _ => Err(format!("{name} is neither an output nor a derivative")),
            }
        };
        unknowns.iter().map(sensitivity).collect()
    }

    pub(crate) fn continuous_states(&self) -> Outcome<&[f64]> {
        self.exchange()?;
        Ok(&self.present)
    }

    pub(crate) fn set_continuous_states(&mut self, x: &[f64]) -> Outcome {
        self.exchange()?;
        self.need("setting the states", &[Phase::Event, Phase::Continuous])?;
        self.check_states(x.len())?;
        if let Some(bad) = x.iter().position(|x| !x.is_finite()) {
            return Err(format!("the state {bad} is not finite"));
        }
        self.present.copy_from_slice(x);
        Ok(())
    }

    /// An error unless the number of states is that of the model.
    pub(crate) fn check_states(&self, given: usize) -> Outcome {
        let states = self.present.len();
        if given == states { Ok(()) } else { Err(format!("{given} numbers for {states} states")) }
    }

    fn exchange(&self) -> Outcome {
        if self.kind() == Kind::ModelExchange {
            return Ok(());
        }
        Err(String::from("an instance of co-simulation has no continuous states"))
    }

    pub(crate) fn derivatives(&self) -> Outcome<Vec<f64>> {
        self.exchange()?;
        self.derivatives_at_present()
    }

    pub(crate) fn nominals(&self) -> Outcome<Vec<f64>> {
        self.exchange()?;
        let variables = &self.resource.variables;
        let nominal = |index: usize| {
            let reference = variables.reference(variables.state(index));
            reference.map_or(1.0, |reference| variables.all()[reference].nominal)
        };
        Ok((0..self.present.len()).map(nominal).collect())
    }

    pub(crate) fn set_time(&mut self, time_s: f64) -> Outcome {
        self.exchange()?;
        self.need("setting the time", &[Phase::Event, Phase::Continuous])?;
        self.time_s = finite("the time", time_s)?;
        Ok(())
    }

    /// Enters event mode or continuous time of model exchange.
    pub(crate) fn enter(&mut self, phase: Phase) -> Outcome {
        self.exchange()?;
        self.need("a change of the mode", &[Phase::Event, Phase::Continuous])?;
        self.phase = phase;
        Ok(())
    }

    /// An error unless the instance is in a mode of model exchange.
    pub(crate) fn check_mode(&self, action: &str, phases: &[Phase]) -> Outcome {
        self.exchange()?;
        self.need(action, phases)
    }

    /// Derivatives of the present states, also in co-simulation.
    pub(crate) fn derivatives_at_present(&self) -> Outcome<Vec<f64>> {
        Ok(self.rates(None)?.iter().map(|rate| rate.value).collect())
    }
}
