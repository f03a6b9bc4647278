//! The geofence.

use hydroid_core::guidance::Border;

/// Area that the boat must not leave.
///
/// All rules of an experiment use three properties, which any star-shaped area has: the signed distance to the border, an
/// interior point towards which the boat returns, and the distance of this point from the border.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fence {
    Circle {
        /// Centre \[m north\].
        north: f64,
        /// Centre \[m east\].
        east: f64,
        /// Radius \[m\].
        radius: f64,
    },
}

impl Fence {
    /// Distance of a point from the border \[m\], negative outside.
    pub fn margin(&self, north: f64, east: f64) -> f64 {
        match self {
            Self::Circle { north: n, east: e, radius } => radius - (north - n).hypot(east - e),
        }
    }

    /// The border in a frame with another origin, north and east \[m\].
    pub fn border(&self, [north, east]: [f64; 2]) -> Border {
        match self {
            Self::Circle { north: n, east: e, radius } => {
                Border::Circle { centre: [n - north, e - east], radius: *radius }
            }
        }
    }

    /// Point to which the boat returns, north and east \[m\].
    pub fn interior(&self) -> [f64; 2] {
        match self {
            Self::Circle { north, east, .. } => [*north, *east],
        }
    }

    /// Distance of the interior point from the border \[m\]: the radius of a circle.
    pub fn size(&self) -> f64 {
        let [north, east] = self.interior();
        self.margin(north, east)
    }

    /// The unit vector from a point to the interior point; zero at that point.
    pub(super) fn inward(&self, north: f64, east: f64) -> [f64; 2] {
        let [n, e] = self.interior();
        let (dn, de) = (n - north, e - east);
        let distance = dn.hypot(de);
        if distance > 0.0 { [dn / distance, de / distance] } else { [0.0, 0.0] }
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let Self::Circle { north, east, radius } = self;
        if !(north.is_finite() && east.is_finite()) {
            return Err(format!("the centre of the fence is ({north}, {east}) m; give two numbers"));
        }
        if !(radius.is_finite() && *radius > 0.0) {
            return Err(format!(
                "the radius of the fence is {radius} m; give a number of metres greater than 0"
            ));
        }
        Ok(())
    }
}
