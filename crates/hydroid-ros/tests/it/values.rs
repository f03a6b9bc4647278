//! Messages of any type: as CDR, read back by the reader of recordings, and as rows.

use std::collections::BTreeMap;

use hydroid_io::{McapChannel, McapWriter, RosNumber, RosShape, RosType, Sink, Topic, scan};
use hydroid_ros::value::{Fields, Seed, Value, time};
use proptest::prelude::*;
use serde::de::DeserializeSeed as _;

const TYPES: [&str; 14] = [
    "std_msgs/msg/Float64",
    "std_msgs/msg/Bool",
    "std_msgs/msg/Int16",
    "std_msgs/msg/Float32MultiArray",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/JointState",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rosgraph_msgs/msg/Clock",
];

/// Any message of a shape.
fn any_of(shape: &RosShape) -> BoxedStrategy<Value> {
    match shape {
        RosShape::Number(number) => {
            let number = *number;
            let range =
                if matches!(number, RosNumber::F32 | RosNumber::F64) { -1e6..1e6 } else { 0.0..100.0 };
            range.prop_map(move |value| Value::number(number, value)).boxed()
        }
        RosShape::Text => "[a-zA-Zäß]{0,9}".prop_map(Value::Text).boxed(),
        RosShape::Sequence(of) => {
            proptest::collection::vec(any_of(of), 0..4).prop_map(Value::Sequence).boxed()
        }
        RosShape::Array(of, count) => {
            proptest::collection::vec(any_of(of), *count).prop_map(Value::Parts).boxed()
        }
        RosShape::Struct(_, parts) => {
            parts.iter().map(|(_, part)| any_of(part)).collect::<Vec<_>>().prop_map(Value::Parts).boxed()
        }
    }
}

fn any_message() -> impl Strategy<Value = (RosType, Value)> {
    proptest::sample::select(TYPES.to_vec()).prop_flat_map(|name| {
        let of = RosType::new(name, None).unwrap();
        let value = any_of(&of.shape);
        (Just(of), value)
    })
}

/// The row of the only message of a file by the names of its fields, and its stamp.
#[derive(Default)]
struct Rows {
    topics: Vec<Topic>,
    row: BTreeMap<String, f64>,
    stamp_ns: i64,
}

impl Sink for Rows {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        self.topics.truncate(id);
        self.topics.push(topic.clone());
        true
    }

    fn row(&mut self, id: usize, stamp_ns: i64, _: Option<i64>, values: &[f64]) {
        let names = self.topics[id].fields.iter().map(|field| field.name.clone());
        self.row = names.zip(values.iter().copied()).collect();
        self.stamp_ns = stamp_ns;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn the_reader_of_recordings_gives_the_same_numbers((of, value) in any_message()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.mcap");
        let mut writer = McapWriter::create(&path, "test").unwrap();
        let channel = writer
            .channel(&McapChannel {
                topic: "/topic",
                encoding: "cdr",
                schema: &of.name,
                schema_encoding: "ros2msg",
                definition: &of.definition,
                units: &[],
            })
            .unwrap();
        writer.message(channel, 77, 77, &value.to_cdr()).unwrap();
        writer.finish().unwrap();
        let mut read = Rows::default();
        let summary = scan(path.to_str().unwrap(), &mut read).unwrap();
        prop_assert_eq!(summary.lost_parts, 0, "{:?}", summary.losses);

        let fields = Fields::of(&of.shape);
        let row: BTreeMap<&str, f64> =
            fields.names().iter().map(String::as_str).zip(fields.row(&value)).collect();
        prop_assert_eq!(read.stamp_ns, fields.stamp_ns(&value).unwrap_or(77));
        for (name, number) in &read.row {
            // A recording has elements of sequences of structs, too.
            let Some(own) = row.get(name.as_str()) else {
                prop_assert!(name.contains('['), "{}", name);
                continue;
            };
            prop_assert!(own == number || own.is_nan() && number.is_nan(), "{}: {} and {}", name, own, number);
        }
        for (name, own) in row {
            let is_yaw = name.rsplit('.').next() == Some("yaw");
            prop_assert!(own.is_nan() || is_yaw || read.row.contains_key(name), "{}", name);
        }
    }

    #[test]
    fn a_message_is_read_as_it_was_written((of, value) in any_message()) {
        let bytes = value.to_cdr();
        let mut from = cdr_encoding::CdrDeserializer::<byteorder::LittleEndian>::new(&bytes[4..]);
        let read = Seed(&of.shape).deserialize(&mut from).unwrap();
        prop_assert_eq!(read, value);
    }

    #[test]
    fn damaged_messages_are_errors(of in proptest::sample::select(TYPES.to_vec()), bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let of = RosType::new(of, None).unwrap();
        let mut from = cdr_encoding::CdrDeserializer::<byteorder::LittleEndian>::new(&bytes);
        // Nothing but a value or an error.
        let _ = Seed(&of.shape).deserialize(&mut from);
    }
}

#[test]
fn a_field_is_set_by_its_name() {
    let of = RosType::new("sensor_msgs/msg/JointState", None).unwrap();
    let fields = Fields::of(&of.shape);
    let at = |name: &str| fields.names().iter().position(|field| field == name).unwrap();
    let mut message = Value::zero(&of.shape);
    fields.set(&mut message, at("velocity[2]"), 1.5);
    fields.stamp(&mut message, 3_000_000_007);
    let row = fields.row(&message);
    assert_eq!(row[at("velocity[2]")], 1.5);
    assert_eq!(row[at("velocity[0]")], 0.0);
    assert!(row[at("velocity[3]")].is_nan());
    assert_eq!(fields.stamp_ns(&message), Some(3_000_000_007));
    assert_eq!(time(3_000_000_007), Value::Parts(vec![Value::I32(3), Value::U32(7)]));
}

#[test]
fn the_yaw_of_a_quaternion_is_a_field() {
    let of = RosType::new("geometry_msgs/msg/QuaternionStamped", None).unwrap();
    let fields = Fields::of(&of.shape);
    let yaw = fields.names().iter().position(|name| name == "quaternion.yaw").unwrap();
    assert!(!fields.can_set(yaw));
    let mut message = Value::zero(&of.shape);
    let half = 0.5_f64 * 0.7;
    for (name, value) in [("quaternion.z", half.sin()), ("quaternion.w", half.cos())] {
        fields.set(&mut message, fields.names().iter().position(|field| field == name).unwrap(), value);
    }
    assert!((fields.row(&message)[yaw] - 0.7).abs() < 1e-12);
}

#[test]
fn own_types_have_their_parts() {
    let of = RosType::new(
        "my_msgs/msg/Thrust",
        Some(
            "std_msgs/Header header\nfloat32[2] thrust\nPart part\n===========\nMSG: my_msgs/Part\nint8 n\n",
        ),
    );
    let of = of.unwrap();
    assert_eq!(of.name, "my_msgs/msg/Thrust");
    assert_eq!(Fields::of(&of.shape).names(), ["thrust[0]", "thrust[1]", "part.n"]);
    assert_eq!(RosType::new(&of.name, Some(&of.definition)).unwrap().shape, of.shape);
    for (name, definition, told) in [
        ("my_msgs/msg/Thrust", None, "none of the common types"),
        ("my_msgs/msg/Thrust", Some("Other other"), "Other"),
        ("Thrust", Some("float64 x"), "no package"),
        ("my_msgs/msg/Thrust", Some("wstring x"), "cannot be decoded"),
    ] {
        let error = RosType::new(name, definition).unwrap_err();
        assert!(error.contains(told), "{error}");
    }
}
