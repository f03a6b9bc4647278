//! Methods of sessions by name.

/// Plain behaviour of sessions around no other one, by the names of the methods of
/// [`Predictor`](crate::predict::Predictor): a `warm_up` of one sample, `advance_observe`, `rollout_batch` and
/// `rollout_snapshots` in terms of the other methods, and `over_ground` for a model of the motion over ground, which
/// ignores headings and knows no current. For adapters, `no_guard` and `no_rehearsal`.
///
/// ```
/// # use hydroid_core::predict::{Predictor, Workspace, plain};
/// # #[derive(Clone)]
/// /// An output that stays at zero.
/// struct Zero;
///
/// impl Predictor for Zero {
///     plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);
///     // The other methods.
/// #   fn outputs(&self) -> usize { 1 }
/// #   fn inputs(&self) -> usize { 1 }
/// #   fn reset(&mut self) {}
/// #   fn observe(&mut self, _: &[f64]) {}
/// #   fn advance(&mut self, _: &[f64]) {}
/// #   fn output(&self, y: &mut [f64]) { y.fill(0.0); }
/// #   fn rollout(&self, _: &[f64], _: &mut Workspace, y: &mut [f64]) { y.fill(0.0); }
/// #   fn snapshot_len(&self) -> usize { 0 }
/// #   fn snapshot(&self, _: &mut [f64]) {}
/// #   fn restore(&mut self, _: &[f64]) {}
/// #   fn fork(&self) -> Box<dyn Predictor> { Box::new(Self) }
/// }
/// ```
#[macro_export]
#[doc(hidden)]
macro_rules! plain_session {
    ($($method:ident)*) => { $($crate::plain_session!(@$method);)* };
    (@warm_up) => { fn warm_up(&self) -> usize { 1 } };
    (@over_ground) => {
        fn observe_heading(&mut self, _: f64) {}
        fn current(&self) -> Option<&$crate::predict::Current> { None }
        fn output_through_water(&self, y: &mut [f64]) { self.output(y); }
    };
    (@advance_observe) => {
        fn advance_observe(&mut self, c: &[f64], y: &[f64]) {
            self.advance(c);
            self.observe(y);
        }
    };
    (@rollout_batch) => {
        fn rollout_batch(
            &self,
            count: usize,
            commands: &[f64],
            work: &mut $crate::predict::Workspace,
            y: &mut [f64],
        ) {
            $crate::predict::rollout_each(self, count, commands, work, y);
        }
    };
    (@rollout_snapshots) => {
        fn rollout_snapshots(
            &mut self,
            count: usize,
            snapshots: &[f64],
            commands: &[f64],
            work: &mut $crate::predict::Workspace,
            y: &mut [f64],
        ) {
            $crate::predict::restore_and_roll_out(self, count, snapshots, commands, work, y);
        }
    };
    (@no_guard) => { fn guard(&self) -> Option<&$crate::adapt::guard::Guard> { None } };
    (@no_rehearsal) => {
        fn rehearsal(&self) -> Option<&$crate::adapt::kalman::RehearsalOptions> { None }
        fn store_window(&mut self, _: &[f64], _: &[f64]) {}
    };
}

/// Methods of [`Predictor`], [`Learning`](crate::adapt::Learning), [`SaveState`](crate::adapt::SaveState) and
/// [`Rehearsing`](crate::adapt::Rehearsing) that call the method of a field.
#[macro_export]
#[doc(hidden)]
macro_rules! delegate_session {
    ($field:ident: $($method:ident)*) => { $($crate::delegate_session!(@$method $field);)* };
    (@outputs $field:ident) => { fn outputs(&self) -> usize { self.$field.outputs() } };
    (@inputs $field:ident) => { fn inputs(&self) -> usize { self.$field.inputs() } };
    (@warm_up $field:ident) => { fn warm_up(&self) -> usize { self.$field.warm_up() } };
    (@reset $field:ident) => { fn reset(&mut self) { self.$field.reset(); } };
    (@observe_heading $field:ident) => {
        fn observe_heading(&mut self, heading: f64) { self.$field.observe_heading(heading); }
    };
    (@current $field:ident) => {
        fn current(&self) -> Option<&$crate::predict::Current> { self.$field.current() }
    };
    (@output_through_water $field:ident) => {
        fn output_through_water(&self, y: &mut [f64]) { self.$field.output_through_water(y); }
    };
    (@observe $field:ident) => { fn observe(&mut self, y: &[f64]) { self.$field.observe(y); } };
    (@advance $field:ident) => { fn advance(&mut self, c: &[f64]) { self.$field.advance(c); } };
    (@output $field:ident) => { fn output(&self, y: &mut [f64]) { self.$field.output(y); } };
    (@rollout $field:ident) => {
        fn rollout(&self, commands: &[f64], work: &mut $crate::predict::Workspace, y: &mut [f64]) {
            self.$field.rollout(commands, work, y);
        }
    };
    (@rollout_batch $field:ident) => {
        fn rollout_batch(
            &self,
            count: usize,
            commands: &[f64],
            work: &mut $crate::predict::Workspace,
            y: &mut [f64],
        ) {
            self.$field.rollout_batch(count, commands, work, y);
        }
    };
    (@snapshot_len $field:ident) => { fn snapshot_len(&self) -> usize { self.$field.snapshot_len() } };
    (@snapshot $field:ident) => { fn snapshot(&self, into: &mut [f64]) { self.$field.snapshot(into); } };
    (@restore $field:ident) => { fn restore(&mut self, from: &[f64]) { self.$field.restore(from); } };
    (@rollout_snapshots $field:ident) => {
        fn rollout_snapshots(
            &mut self,
            count: usize,
            snapshots: &[f64],
            commands: &[f64],
            work: &mut $crate::predict::Workspace,
            y: &mut [f64],
        ) {
            self.$field.rollout_snapshots(count, snapshots, commands, work, y);
        }
    };
    (@fork $field:ident) => { fn fork(&self) -> $crate::predict::Fork { self.$field.fork() } };
    (@outcome $field:ident) => { fn outcome(&self) -> $crate::adapt::Outcome { self.$field.outcome() } };
    (@innovations $field:ident) => {
        fn innovations(&self) -> &[$crate::adapt::Innovation] { self.$field.innovations() }
    };
    (@weights $field:ident) => { fn weights(&self) -> &[f64] { self.$field.weights() } };
    (@freeze $field:ident) => { fn freeze(&mut self, frozen: bool) { self.$field.freeze(frozen); } };
    (@scale_noise $field:ident) => {
        fn scale_noise(&mut self, factor: f64) { self.$field.scale_noise(factor); }
    };
    (@restart $field:ident) => { fn restart(&mut self) { self.$field.restart(); } };
    (@health $field:ident) => { fn health(&self) -> $crate::adapt::Health { self.$field.health() } };
    (@guard $field:ident) => {
        fn guard(&self) -> Option<&$crate::adapt::guard::Guard> { self.$field.guard() }
    };
    (@deviations $field:ident) => {
        fn deviations(
            &mut self,
            commands: &[f64],
            horizons: &[usize],
            work: &mut $crate::predict::Workspace,
            deviations: &mut [f64],
        ) {
            self.$field.deviations(commands, horizons, work, deviations);
        }
    };
    (@is_sound $field:ident) => { fn is_sound(&self) -> bool { self.$field.is_sound() } };
    (@rehearsal $field:ident) => {
        fn rehearsal(&self) -> Option<&$crate::adapt::kalman::RehearsalOptions> { self.$field.rehearsal() }
    };
    (@store_window $field:ident) => {
        fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
            self.$field.store_window(outputs, commands);
        }
    };
}
