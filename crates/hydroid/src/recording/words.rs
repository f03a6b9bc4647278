//! Words of the names of fields, and the quantities that they state.

use crate::log::units::{self, Unit};

/// A quantity that a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Latitude,
    Longitude,
    Quality,
    Speed,
    Course,
    North,
    East,
    PlaceNorth,
    PlaceEast,
    Heading,
    YawRate,
    Forward,
    Starboard,
    /// The yaw rate beside surge and sway.
    Turn,
    Surge,
    Sway,
}

/// Names of quantities, the usual one first, as words without blanks. Devices and units are left out of a name before.
const QUANTITIES: &[(Quantity, &[&str])] = &[
    (Quantity::Latitude, &["latitude", "lat", "breite", "breitengrad"]),
    (Quantity::Longitude, &["longitude", "lon", "lng", "long", "laenge", "laengengrad"]),
    (Quantity::Quality, &["quality", "fixtype", "statusstatus", "status", "fix", "fixquality"]),
    (
        Quantity::Speed,
        &[
            "sog",
            "spd",
            "speedoverground",
            "vel",
            "gspeed",
            "groundspeed",
            "speed",
            "gs",
            "fahrtuebergrund",
            "fahrtuegrund",
            "fueg",
            "fahrt",
        ],
    ),
    (
        Quantity::Course,
        &[
            "cog",
            "gcrs",
            "courseoverground",
            "groundcourse",
            "course",
            "track",
            "kursuebergrund",
            "kursuegrund",
            "kueg",
            "kurs",
        ],
    ),
    (Quantity::North, &["veln", "velocitynorth", "vn", "velnorth", "vnorth", "northvelocity"]),
    (Quantity::East, &["vele", "velocityeast", "ve", "veleast", "veast", "eastvelocity"]),
    (
        Quantity::PlaceNorth,
        &[
            "north",
            "northing",
            "positionnorth",
            "posnorth",
            "northposition",
            "posn",
            "x",
            "positionx",
            "posx",
        ],
    ),
    (
        Quantity::PlaceEast,
        &["east", "easting", "positioneast", "poseast", "eastposition", "y", "positiony", "posy"],
    ),
    (
        Quantity::Heading,
        &[
            "heading",
            "hdg",
            "trueheading",
            "headingtrue",
            "hdgtrue",
            "hdt",
            "yaw",
            "psi",
            "q0",
            "orientationw",
            "steuerkurs",
            "kompass",
            "kompasskurs",
            "compass",
            "compassheading",
            "yawangle",
            "headingmagnetic",
            "hdgmag",
            "hdm",
            "maghdg",
            "magheading",
            "magneticheading",
        ],
    ),
    (
        Quantity::YawRate,
        &[
            "gyroz",
            "gyrz",
            "wz",
            "yawrate",
            "angularvelocityz",
            "gyro2",
            "gz",
            "rate",
            "rateofturn",
            "r",
            "rot",
            "turnrate",
            "yawspeed",
            "omegaz",
            "drehrate",
            "gierrate",
            "wendegeschwindigkeit",
        ],
    ),
    (Quantity::Forward, &["accx", "linearaccelerationx", "accelerometer0", "ax", "accelx", "accelerationx"]),
    (
        Quantity::Starboard,
        &["accy", "linearaccelerationy", "accelerometer1", "ay", "accely", "accelerationy"],
    ),
    (Quantity::Turn, &["r", "yawrate"]),
    (Quantity::Surge, &["u"]),
    (Quantity::Sway, &["v"]),
];

/// Words of devices and forms of numbers, which state no quantity.
pub(super) const DEVICES: &[&str] = &[
    "gps", "gnss", "rtk", "imu", "ins", "ahrs", "nav", "boat", "vessel", "ship", "usv", "own", "my",
    "sensor", "dd", "decimal", "deg", "us", "raw", "value", "pct", "percent",
];

/// Words of a name that states something else than the present state of the vessel.
const NOT_OWN: &[&str] = &[
    "error",
    "err",
    "std",
    "sigma",
    "accuracy",
    "var",
    "variance",
    "offset",
    "bias",
    "home",
    "wp",
    "waypoint",
    "dest",
    "destination",
    "goal",
    "base",
    "origin",
    "start",
    "next",
    "prev",
    "ais",
    "wind",
    "water",
    "stw",
];

/// Words of a text in lower case, without umlauts: they end at other characters than letters and digits, between letters and
/// digits, and where the case begins anew.
pub(super) fn words(text: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let chars: Vec<char> = text.chars().collect();
    for (k, &c) in chars.iter().enumerate() {
        let begins = k.checked_sub(1).is_some_and(|before| {
            let before = chars[before];
            let next_is_small = chars.get(k + 1).is_some_and(|next| next.is_lowercase());
            before.is_alphabetic() != c.is_alphabetic()
                || c.is_uppercase() && (before.is_lowercase() || next_is_small)
        });
        if begins {
            words.push(String::new());
        }
        if !c.is_alphanumeric() {
            continue;
        }
        let Some(word) = words.last_mut() else { continue };
        for c in c.to_lowercase() {
            match c {
                'ä' => word.push_str("ae"),
                'ö' => word.push_str("oe"),
                'ü' => word.push_str("ue"),
                'ß' => word.push_str("ss"),
                c => word.push(c),
            }
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Whether a text has one of some words.
pub(super) fn has_word(text: &str, of: &[&str]) -> bool {
    words(text).iter().any(|word| of.contains(&word.as_str()))
}

/// Whether a word is a unit of motion. Single letters are parts of names.
pub(super) fn is_unit(word: &str) -> bool {
    use units::Quantity::{Acceleration, Angle, Rotation, Speed};
    let of =
        |unit: Unit| unit.quantity.is_some_and(|of| [Speed, Rotation, Angle, Acceleration].contains(&of));
    word.len() > 1 && Unit::parse(word).is_ok_and(of)
}

/// A name of a field.
#[derive(Clone, Debug)]
pub(super) struct Name {
    /// Words without the unit.
    words: Vec<String>,
    /// Unit that it states.
    pub(super) unit: Option<String>,
}

impl Name {
    pub(super) fn of(text: &str) -> Self {
        // The index of an element stands behind the unit.
        let indexed = text.strip_suffix(']').and_then(|front| front.rsplit_once('['));
        let (front, index) = indexed.map_or((text, None), |(front, index)| (front, Some(index)));
        let (stem, unit) = units::from_name(front, false)
            .map_or((front, None), |(stem, unit)| (stem, Some(unit.to_owned())));
        let mut all = words(stem);
        let mut unit = unit;
        if unit.is_none() && all.len() > 1 {
            unit = all.pop_if(|word| is_unit(word));
        }
        all.extend(index.map(str::to_lowercase));
        Self { words: all, unit }
    }

    /// The place of a quantity among its names, if it is stated by the words without devices, or by some of them that follow
    /// each other, and the other words.
    fn place(&self, quantity: Quantity) -> Option<(usize, Vec<&str>)> {
        let (_, names) = QUANTITIES.iter().find(|(of, _)| *of == quantity)?;
        let n = self.words.len();
        let mut runs = (1..=n).rev().flat_map(|length| (0..=n - length).map(move |from| from..from + length));
        runs.find_map(|run| {
            let squeezed = self.words[run.clone()].concat();
            let at = names.iter().position(|name| *name == squeezed)?;
            let others = self.words.iter().enumerate().filter(|(k, _)| !run.contains(k));
            let others = others.map(|(_, word)| word.as_str());
            Some((at, others.filter(|word| !DEVICES.contains(word) && !is_unit(word)).collect()))
        })
    }

    /// The place of a quantity among its names, 0 for the usual one.
    pub(super) fn rank(&self, quantity: Quantity) -> Option<usize> {
        self.place(quantity).filter(|(_, others)| others.is_empty()).map(|(at, _)| at)
    }

    /// The other words of a name that states a quantity of the vessel itself.
    pub(super) fn others(&self, quantity: Quantity) -> Option<Vec<&str>> {
        let (_, others) = self.place(quantity)?;
        let is_own = !others.iter().any(|word| NOT_OWN.contains(word) || super::actuators::is_role(word));
        (is_own && !others.is_empty()).then_some(others)
    }

    /// Whether it is the German word for a course, which may be a heading.
    pub(super) fn is_kurs(&self) -> bool {
        self.words.last().is_some_and(|word| word == "kurs")
    }

    /// Whether it is that of a magnetic direction.
    pub(super) fn is_magnetic(&self) -> bool {
        self.words
            .iter()
            .any(|word| ["magnetic", "mag", "hdm", "kompass", "compass"].contains(&word.as_str()))
    }

    /// The quantity of the motion that it states, whatever the words of commands in it say.
    pub(super) fn motion(&self) -> Option<Quantity> {
        let motion = [
            Quantity::Latitude,
            Quantity::Longitude,
            Quantity::Speed,
            Quantity::Course,
            Quantity::Heading,
            Quantity::YawRate,
            Quantity::Surge,
            Quantity::Sway,
        ];
        let is_only =
            |(_, others): (usize, Vec<&str>)| others.iter().all(|word| super::actuators::is_role(word));
        motion.into_iter().find(|quantity| self.place(*quantity).is_some_and(is_only))
    }
}

/// Quantities whose names have words in common, as a device that measures them.
pub(super) const SHARED: [Quantity; 8] = [
    Quantity::Latitude,
    Quantity::Longitude,
    Quantity::Speed,
    Quantity::Course,
    Quantity::North,
    Quantity::East,
    Quantity::Heading,
    Quantity::YawRate,
];
