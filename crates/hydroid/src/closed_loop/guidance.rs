//! One sample of path control: reference and preview at the measured pose, and the command of a controller.

use hydroid_core::control::Status;
use hydroid_core::guidance::{Pose, Reference};
use hydroid_core::memory::Memory;

use super::controller::{ClosedLoopController, ModelSession, Observation};
use super::reference::ReferenceGenerator;
use super::track::Track;

/// What is known of the vessel at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Pose `[x, y, psi]` in north, east \[m\] and clockwise from north \[rad\].
    pub eta: [f64; 3],
    /// Body velocities over ground `[u, v, r]` \[m/s, m/s, rad/s\].
    pub nu: [f64; 3],
    /// Measured outputs of the plant.
    pub outputs: &'a [f64],
    /// Session of the model for a controller that does not own one.
    pub session: Option<ModelSession<'a>>,
}

/// Result of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guided {
    /// Reference of the sample.
    pub reference: Reference,
    /// Distance of the controlled point from its reference \[m\].
    pub distance: f64,
    /// Part of it along the course of the reference \[m\], positive if the vessel is behind.
    pub lag: f64,
    /// Cross-track error of the controlled point \[m\], positive to starboard of the path.
    pub cross_track: f64,
    /// Status of the controller.
    pub status: Status,
}

/// A reference track along which a controller steers, sample by sample.
pub struct Guidance {
    generator: ReferenceGenerator,
    preview: Vec<Reference>,
    lead: f64,
    step: usize,
    dt_s: f64,
}

impl Guidance {
    /// The start of a track, for the samples of a controller.
    pub fn new(track: Track, controller: &dyn ClosedLoopController, dt_s: f64) -> Self {
        let mut generator = ReferenceGenerator::new(track, controller.timing(), dt_s);
        let (first, _) = generator.update([f64::NAN; 2]);
        let preview = vec![first; controller.horizon()];
        Self { generator, preview, lead: controller.lead(), step: controller.preview_step(), dt_s }
    }

    /// The track.
    pub const fn track(&self) -> &Track {
        self.generator.track()
    }

    /// Computes the command of a sample with the controller for which the guidance was made.
    pub fn command(
        &mut self,
        controller: &mut dyn ClosedLoopController,
        measured: &Measured<'_>,
        command: &mut [f64],
    ) -> Guided {
        let [x, y, psi] = measured.eta;
        let (sin, cos) = psi.sin_cos();
        let point = [x + self.lead * cos, y + self.lead * sin];
        let (reference, cross_track) = self.generator.update(point);
        self.generator.preview(self.dt_s, self.step, &mut self.preview);
        let observation = Observation {
            eta: measured.eta,
            nu: measured.nu,
            outputs: measured.outputs,
            reference: &reference,
            preview: &self.preview,
            session: measured.session,
        };
        let status = controller.command(&observation, command);
        let [north, east] = [0, 1].map(|axis| reference.position[axis] - point[axis]);
        let (sin, cos) = reference.course.sin_cos();
        let (distance, lag) = (north.hypot(east), north * cos + east * sin);
        Guided { reference, distance, lag, cross_track, status }
    }

    /// Plans a way from the pose of the vessel to its task, with turns of a radius \[m\]. Returns its length without the part
    /// of the task that is done \[m\], and its time \[s\]; `None` if all ways leave the fence.
    pub fn plan(&mut self, eta: [f64; 3], nu: [f64; 3], radius: f64) -> Option<[f64; 2]> {
        let [x, y, psi] = eta;
        let (sin, cos) = psi.sin_cos();
        let position = [x + self.lead * cos, y + self.lead * sin];
        self.generator.plan(Pose { position, course: psi, curvature: 0.0 }, nu[0], radius)
    }

    /// The reference moves with a part of the speed of its profile; with 0 it stands and waits for the vessel.
    pub fn pace(&mut self, pace: f64) {
        self.generator.pace(pace);
    }

    /// What is left of the way to the task \[m\]; 0 on the task.
    pub fn approach_m(&self) -> f64 {
        self.generator.approach_m()
    }

    /// Moves the reference to the next sample.
    pub fn advance(&mut self) {
        self.generator.advance(self.dt_s);
    }

    /// Continues after `gap_s` seconds without a sample from the projection of the vessel on the path, which is searched
    /// within the distance that the reference covers in this time.
    pub fn resume(&mut self, gap_s: f64, position: [f64; 2]) {
        self.generator.resume(gap_s, position);
    }

    /// Whether the end of an open path has been reached.
    pub fn is_done(&self) -> bool {
        self.generator.is_done()
    }

    /// Visits the numbers of the state; see [`ClosedLoopController::visit_state`].
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.generator.visit_state(memory);
    }
}
