//! Distances on the ellipsoid.

/// WGS 84: semi-major axis \[m\] and squared eccentricity.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;

/// Metres of a radian of latitude and of one of longitude, at a latitude \[rad\]: the radii of curvature.
pub(crate) fn metres_per_radian(latitude: f64) -> [f64; 2] {
    let w = 1.0 - ECCENTRICITY_2 * latitude.sin().powi(2);
    [SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / (w * w.sqrt()), SEMI_MAJOR_M / w.sqrt() * latitude.cos()]
}
