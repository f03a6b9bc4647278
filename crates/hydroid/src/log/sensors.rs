//! Sensors from which the motion is computed.

use hydroid_core::navigation::Noise;

use super::selection::ChannelSpec;

/// Columns of the sensors of a vessel, and their places. Each is optional; a position or a velocity is needed, and a
/// heading or a yaw rate. A column is written as that of a channel: `gnss.lat [deg]`, `imu.gyro_z * -1`.
///
/// Axes are forward, starboard, down (FRD): yaw rate and heading are positive to starboard, the heading is clockwise from
/// north. For axes forward, port, up (FLU), yaw rate and starboard acceleration have the factor -1.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sensors {
    /// Latitude of the GNSS antenna; degrees without a unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude: Option<ChannelSpec>,
    /// Longitude of the GNSS antenna; degrees without a unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longitude: Option<ChannelSpec>,
    /// Position of the antenna north of any point \[m\], instead of the latitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub north: Option<ChannelSpec>,
    /// Position of the antenna east of any point \[m\], instead of the longitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub east: Option<ChannelSpec>,
    /// Kind of the position fix. Fixes of each kind have a noise of their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<ChannelSpec>,
    /// Speed of the antenna over ground \[m/s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<ChannelSpec>,
    /// Course of the antenna over ground \[rad\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub course: Option<ChannelSpec>,
    /// Velocity of the antenna to the north \[m/s\], instead of speed and course.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_north: Option<ChannelSpec>,
    /// Velocity of the antenna to the east \[m/s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_east: Option<ChannelSpec>,
    /// Heading \[rad\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<ChannelSpec>,
    /// Yaw rate \[rad/s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw_rate: Option<ChannelSpec>,
    /// Specific force forward \[m/s²\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_forward: Option<ChannelSpec>,
    /// Specific force to starboard \[m/s²\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_starboard: Option<ChannelSpec>,
    /// Place of the GNSS antenna forward, to starboard and below the origin of the body frame \[m\].
    pub antenna_m: [f64; 3],
    /// Place of the accelerometers \[m\].
    pub imu_m: [f64; 3],
    /// What is known of the sensors from earlier recordings of the vessel. Without it, it is estimated from the recordings
    /// that are read together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<KnownSensors>,
}

/// What recordings of a vessel tell of its sensors and of its motion.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownSensors {
    /// Statistics of motion, waves and correlated errors.
    pub noise: Noise,
    /// Standard deviations of the white noise of position fixes \[m\], by their quality, if fixes have one.
    pub position: Vec<(Option<f64>, f64)>,
    /// Standard deviation of the white noise of the velocity \[m/s\].
    pub velocity: Option<f64>,
    /// Standard deviation of the white noise of the heading \[rad\].
    pub heading: Option<f64>,
    /// Standard deviation of the white noise of the yaw rate \[rad/s\].
    pub yaw_rate: Option<f64>,
    /// Standard deviations of the white noise of the specific force, forward and to starboard \[m/s²\].
    pub acceleration: Option<[f64; 2]>,
    /// Values and standard deviations of the constants of sensors and vessel, in the order of
    /// those of the fit: delay, misalignment, places of the pivot point, heel.
    pub constants: Vec<(f64, f64)>,
}

impl Sensors {
    /// The columns that are named, with the names of the sensors.
    pub fn columns(&self) -> impl Iterator<Item = (&'static str, &ChannelSpec)> {
        [
            ("latitude", &self.latitude),
            ("longitude", &self.longitude),
            ("north", &self.north),
            ("east", &self.east),
            ("quality", &self.quality),
            ("speed", &self.speed),
            ("course", &self.course),
            ("velocity_north", &self.velocity_north),
            ("velocity_east", &self.velocity_east),
            ("heading", &self.heading),
            ("yaw_rate", &self.yaw_rate),
            ("acceleration_forward", &self.acceleration_forward),
            ("acceleration_starboard", &self.acceleration_starboard),
        ]
        .into_iter()
        .filter_map(|(name, spec)| Some((name, spec.as_ref()?)))
    }
}
