//! Sensors from which the motion is computed.

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
