//! Messages of the protocol as topics, with the names of the protocol. Values are in the stated units: positions in degrees,
//! velocities in m/s, where the messages have integers of other scales. `RC_CHANNELS_OVERRIDE` and
//! `SET_POSITION_TARGET_LOCAL_NED` are the commands that [`helm`](super::helm) sends.

use ::mavlink::dialects::ardupilotmega::{GpsFixType, MavMessage};

use crate::link::{Field, Topic};

/// Stamp in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamp {
    /// Microseconds since the start of the autopilot.
    Boot(u64),
    /// As [`Boot`](Self::Boot), in 32 bits, which begin again after 71 minutes.
    ShortBoot(u32),
    /// As [`Boot`](Self::Boot), of the last fix of a GNSS receiver, which may be long ago.
    Fix(u64),
    /// Microseconds since 1970.
    Utc(u64),
    None,
}

/// Microseconds from 1970 or from the start: which of them is known by their size.
fn since(us: u64) -> Stamp {
    // A thousand days after a start, or nine hundred days after 1970.
    if us > 80_000_000_000_000 { Stamp::Utc(us) } else { Stamp::Boot(us) }
}

/// Time of a fix; none without one.
fn fix(us: u64) -> Stamp {
    match since(us) {
        Stamp::Boot(0) => Stamp::None,
        Stamp::Boot(us) => Stamp::Fix(us),
        stamp => stamp,
    }
}

fn ms(ms: u32) -> Stamp {
    Stamp::Boot(1000 * u64::from(ms))
}

/// The value unless it is the largest one, which stands for none.
fn known(value: u16) -> f64 {
    if value == u16::MAX { f64::NAN } else { f64::from(value) }
}

/// Pulse width \[us\]; 0 stands for none.
fn pulse(value: u16) -> f64 {
    if value == 0 { f64::NAN } else { known(value) }
}

/// A value of a fix; NaN without one, where a receiver repeats old values or sends zeros.
fn of_fix(kind: GpsFixType, value: f64) -> f64 {
    if (kind as u32) < GpsFixType::GPS_FIX_TYPE_2D_FIX as u32 { f64::NAN } else { value }
}

/// Standard gravity \[m/s²\].
const GRAVITY: f64 = 9.80665;

/// Specific force \[m/s²\] from thousandths of the standard gravity.
fn force(value: i16) -> f64 {
    f64::from(value) * GRAVITY / 1000.0
}

macro_rules! topics {
    ($($message:ident $m:ident $stamp:expr => { $($field:ident $unit:literal $value:expr,)* })*) => {
        pub const TOPICS: &[Topic] = &[$(Topic {
            name: stringify!($message),
            fields: &[$(Field { name: stringify!($field), unit: $unit }),*],
            messages: None,
        }),*];

        #[expect(non_camel_case_types, clippy::upper_case_acronyms, reason = "the names of the protocol")]
        enum Index { $($message),* }

        /// Index of the topic and stamp of a message, with its values; `None` if it is not a topic.
        pub fn row(message: &MavMessage, values: &mut Vec<f64>) -> Option<(usize, Stamp)> {
            values.clear();
            match message {
                // Outputs 17 and above.
                MavMessage::SERVO_OUTPUT_RAW(m) if m.port != 0 => None,
                $(MavMessage::$message($m) => {
                    values.extend([$($value),*]);
                    Some((Index::$message as usize, $stamp))
                })*
                _ => None,
            }
        }
    };
}

topics! {
    GPS_RAW_INT m fix(m.time_usec) => {
        lat "deg" of_fix(m.fix_type, f64::from(m.lat) / 1e7),
        lon "deg" of_fix(m.fix_type, f64::from(m.lon) / 1e7),
        alt "m" f64::from(m.alt) / 1e3,
        eph "" known(m.eph) / 100.0,
        vel "m/s" of_fix(m.fix_type, known(m.vel) / 100.0),
        cog "deg" of_fix(m.fix_type, known(m.cog) / 100.0),
        fix_type "" f64::from(m.fix_type as u32),
        satellites_visible "" f64::from(m.satellites_visible),
    }
    GPS2_RAW m fix(m.time_usec) => {
        lat "deg" of_fix(m.fix_type, f64::from(m.lat) / 1e7),
        lon "deg" of_fix(m.fix_type, f64::from(m.lon) / 1e7),
        alt "m" f64::from(m.alt) / 1e3,
        eph "" known(m.eph) / 100.0,
        vel "m/s" of_fix(m.fix_type, known(m.vel) / 100.0),
        cog "deg" of_fix(m.fix_type, known(m.cog) / 100.0),
        fix_type "" f64::from(m.fix_type as u32),
        satellites_visible "" f64::from(m.satellites_visible),
    }
    GLOBAL_POSITION_INT m ms(m.time_boot_ms) => {
        lat "deg" f64::from(m.lat) / 1e7,
        lon "deg" f64::from(m.lon) / 1e7,
        alt "m" f64::from(m.alt) / 1e3,
        relative_alt "m" f64::from(m.relative_alt) / 1e3,
        vx "m/s" f64::from(m.vx) / 100.0,
        vy "m/s" f64::from(m.vy) / 100.0,
        vz "m/s" f64::from(m.vz) / 100.0,
        hdg "deg" known(m.hdg) / 100.0,
    }
    LOCAL_POSITION_NED m ms(m.time_boot_ms) => {
        x "m" f64::from(m.x),
        y "m" f64::from(m.y),
        z "m" f64::from(m.z),
        vx "m/s" f64::from(m.vx),
        vy "m/s" f64::from(m.vy),
        vz "m/s" f64::from(m.vz),
    }
    ATTITUDE m ms(m.time_boot_ms) => {
        roll "rad" f64::from(m.roll),
        pitch "rad" f64::from(m.pitch),
        yaw "rad" f64::from(m.yaw),
        rollspeed "rad/s" f64::from(m.rollspeed),
        pitchspeed "rad/s" f64::from(m.pitchspeed),
        yawspeed "rad/s" f64::from(m.yawspeed),
    }
    RAW_IMU m since(m.time_usec) => {
        xacc "m/s^2" force(m.xacc),
        yacc "m/s^2" force(m.yacc),
        zacc "m/s^2" force(m.zacc),
        xgyro "rad/s" f64::from(m.xgyro) / 1e3,
        ygyro "rad/s" f64::from(m.ygyro) / 1e3,
        zgyro "rad/s" f64::from(m.zgyro) / 1e3,
    }
    SCALED_IMU m ms(m.time_boot_ms) => {
        xacc "m/s^2" force(m.xacc),
        yacc "m/s^2" force(m.yacc),
        zacc "m/s^2" force(m.zacc),
        xgyro "rad/s" f64::from(m.xgyro) / 1e3,
        ygyro "rad/s" f64::from(m.ygyro) / 1e3,
        zgyro "rad/s" f64::from(m.zgyro) / 1e3,
    }
    SCALED_IMU2 m ms(m.time_boot_ms) => {
        xacc "m/s^2" force(m.xacc),
        yacc "m/s^2" force(m.yacc),
        zacc "m/s^2" force(m.zacc),
        xgyro "rad/s" f64::from(m.xgyro) / 1e3,
        ygyro "rad/s" f64::from(m.ygyro) / 1e3,
        zgyro "rad/s" f64::from(m.zgyro) / 1e3,
    }
    HIGHRES_IMU m since(m.time_usec) => {
        xacc "m/s^2" f64::from(m.xacc),
        yacc "m/s^2" f64::from(m.yacc),
        zacc "m/s^2" f64::from(m.zacc),
        xgyro "rad/s" f64::from(m.xgyro),
        ygyro "rad/s" f64::from(m.ygyro),
        zgyro "rad/s" f64::from(m.zgyro),
    }
    SERVO_OUTPUT_RAW m Stamp::ShortBoot(m.time_usec) => {
        port "" f64::from(m.port),
        servo1_raw "us" pulse(m.servo1_raw),
        servo2_raw "us" pulse(m.servo2_raw),
        servo3_raw "us" pulse(m.servo3_raw),
        servo4_raw "us" pulse(m.servo4_raw),
        servo5_raw "us" pulse(m.servo5_raw),
        servo6_raw "us" pulse(m.servo6_raw),
        servo7_raw "us" pulse(m.servo7_raw),
        servo8_raw "us" pulse(m.servo8_raw),
    }
    RC_CHANNELS m ms(m.time_boot_ms) => {
        chan1_raw "us" pulse(m.chan1_raw),
        chan2_raw "us" pulse(m.chan2_raw),
        chan3_raw "us" pulse(m.chan3_raw),
        chan4_raw "us" pulse(m.chan4_raw),
        chan5_raw "us" pulse(m.chan5_raw),
        chan6_raw "us" pulse(m.chan6_raw),
        chan7_raw "us" pulse(m.chan7_raw),
        chan8_raw "us" pulse(m.chan8_raw),
        rssi "" f64::from(m.rssi),
    }
    RC_CHANNELS_OVERRIDE m Stamp::None => {
        chan1_raw "us" pulse(m.chan1_raw),
        chan2_raw "us" pulse(m.chan2_raw),
        chan3_raw "us" pulse(m.chan3_raw),
        chan4_raw "us" pulse(m.chan4_raw),
        chan5_raw "us" pulse(m.chan5_raw),
        chan6_raw "us" pulse(m.chan6_raw),
        chan7_raw "us" pulse(m.chan7_raw),
        chan8_raw "us" pulse(m.chan8_raw),
    }
    SET_POSITION_TARGET_LOCAL_NED m Stamp::None => {
        vx "m/s" f64::from(m.vx),
        yaw_rate "rad/s" f64::from(m.yaw_rate),
    }
    WIND m Stamp::None => {
        direction "deg" f64::from(m.direction),
        speed "m/s" f64::from(m.speed),
    }
    WIND_COV m since(m.time_usec) => {
        wind_x "m/s" f64::from(m.wind_x),
        wind_y "m/s" f64::from(m.wind_y),
    }
    SYS_STATUS m Stamp::None => {
        voltage_battery "V" known(m.voltage_battery) / 1e3,
        current_battery "A" if m.current_battery < 0 { f64::NAN } else { f64::from(m.current_battery) / 100.0 },
        battery_remaining "%" if m.battery_remaining < 0 { f64::NAN } else { f64::from(m.battery_remaining) },
        load "%" f64::from(m.load) / 10.0,
    }
    EKF_STATUS_REPORT m Stamp::None => {
        flags "" f64::from(m.flags.bits()),
        velocity_variance "" f64::from(m.velocity_variance),
        pos_horiz_variance "" f64::from(m.pos_horiz_variance),
        compass_variance "" f64::from(m.compass_variance),
    }
    HEARTBEAT m Stamp::None => {
        custom_mode "" f64::from(m.custom_mode),
        base_mode "" f64::from(m.base_mode.bits()),
        system_status "" f64::from(m.system_status as u32),
    }
}
