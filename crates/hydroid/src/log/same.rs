//! Columns with the same meaning in the recording of an autopilot and on its link.

/// Columns of DataFlash and messages of `MAVLink`, both of ArduPilot: the same receiver, filter and first inertial unit.
const COLUMNS: [(&str, &str); 17] = [
    ("GPS.Lat", "GPS_RAW_INT.lat"),
    ("GPS.Lng", "GPS_RAW_INT.lon"),
    ("GPS.Alt", "GPS_RAW_INT.alt"),
    ("GPS.Spd", "GPS_RAW_INT.vel"),
    ("GPS.GCrs", "GPS_RAW_INT.cog"),
    ("GPS.Status", "GPS_RAW_INT.fix_type"),
    ("GPS.NSats", "GPS_RAW_INT.satellites_visible"),
    ("GPS.HDop", "GPS_RAW_INT.eph"),
    ("ATT.Roll", "ATTITUDE.roll"),
    ("ATT.Pitch", "ATTITUDE.pitch"),
    ("ATT.Yaw", "ATTITUDE.yaw"),
    ("IMU.GyrX", "RAW_IMU.xgyro"),
    ("IMU.GyrY", "RAW_IMU.ygyro"),
    ("IMU.GyrZ", "RAW_IMU.zgyro"),
    ("IMU.AccX", "RAW_IMU.xacc"),
    ("IMU.AccY", "RAW_IMU.yacc"),
    ("IMU.AccZ", "RAW_IMU.zacc"),
];

/// Numbered columns: the number stands behind the first text, and between the others.
const NUMBERED: [(&str, [&str; 2]); 2] =
    [("RCOU.C", ["SERVO_OUTPUT_RAW.servo", "_raw"]), ("RCIN.C", ["RC_CHANNELS.chan", "_raw"])];

/// The column of a link with the meaning of a column of a recording.
pub(crate) fn on_link(column: &str) -> Option<String> {
    if let Some((_, link)) = COLUMNS.iter().find(|(recorded, _)| *recorded == column) {
        return Some((*link).to_owned());
    }
    NUMBERED.iter().find_map(|(recorded, [before, behind])| {
        let number: u8 = column.strip_prefix(recorded)?.parse().ok()?;
        Some(format!("{before}{number}{behind}"))
    })
}
