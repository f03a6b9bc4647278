//! Definitions of common types of ROS 2, for bags that have none: those of `builtin_interfaces`, `std_msgs`,
//! `geometry_msgs`, `sensor_msgs`, `nav_msgs`, `diagnostic_msgs` and `rosgraph_msgs`, without constants.

use std::fmt::Write as _;

use super::schema::{Schema, short};

/// A type a line: its name and its members.
const TYPES: &str = "\
builtin_interfaces/Time int32 sec, uint32 nanosec
builtin_interfaces/Duration int32 sec, uint32 nanosec
std_msgs/Header builtin_interfaces/Time stamp, string frame_id
std_msgs/Bool bool data
std_msgs/Byte byte data
std_msgs/Char char data
std_msgs/String string data
std_msgs/Int8 int8 data
std_msgs/Int16 int16 data
std_msgs/Int32 int32 data
std_msgs/Int64 int64 data
std_msgs/UInt8 uint8 data
std_msgs/UInt16 uint16 data
std_msgs/UInt32 uint32 data
std_msgs/UInt64 uint64 data
std_msgs/Float32 float32 data
std_msgs/Float64 float64 data
std_msgs/ColorRGBA float32 r, float32 g, float32 b, float32 a
std_msgs/MultiArrayDimension string label, uint32 size, uint32 stride
std_msgs/MultiArrayLayout MultiArrayDimension[] dim, uint32 data_offset
std_msgs/ByteMultiArray MultiArrayLayout layout, byte[] data
std_msgs/Int8MultiArray MultiArrayLayout layout, int8[] data
std_msgs/Int16MultiArray MultiArrayLayout layout, int16[] data
std_msgs/Int32MultiArray MultiArrayLayout layout, int32[] data
std_msgs/Int64MultiArray MultiArrayLayout layout, int64[] data
std_msgs/UInt8MultiArray MultiArrayLayout layout, uint8[] data
std_msgs/UInt16MultiArray MultiArrayLayout layout, uint16[] data
std_msgs/UInt32MultiArray MultiArrayLayout layout, uint32[] data
std_msgs/UInt64MultiArray MultiArrayLayout layout, uint64[] data
std_msgs/Float32MultiArray MultiArrayLayout layout, float32[] data
std_msgs/Float64MultiArray MultiArrayLayout layout, float64[] data
geometry_msgs/Vector3 float64 x, float64 y, float64 z
geometry_msgs/Point float64 x, float64 y, float64 z
geometry_msgs/Point32 float32 x, float32 y, float32 z
geometry_msgs/Quaternion float64 x, float64 y, float64 z, float64 w
geometry_msgs/Pose Point position, Quaternion orientation
geometry_msgs/Pose2D float64 x, float64 y, float64 theta
geometry_msgs/PoseWithCovariance Pose pose, float64[36] covariance
geometry_msgs/Twist Vector3 linear, Vector3 angular
geometry_msgs/TwistWithCovariance Twist twist, float64[36] covariance
geometry_msgs/Accel Vector3 linear, Vector3 angular
geometry_msgs/AccelWithCovariance Accel accel, float64[36] covariance
geometry_msgs/Wrench Vector3 force, Vector3 torque
geometry_msgs/Transform Vector3 translation, Quaternion rotation
geometry_msgs/Polygon Point32[] points
geometry_msgs/PoseArray std_msgs/Header header, Pose[] poses
geometry_msgs/PointStamped std_msgs/Header header, Point point
geometry_msgs/Vector3Stamped std_msgs/Header header, Vector3 vector
geometry_msgs/QuaternionStamped std_msgs/Header header, Quaternion quaternion
geometry_msgs/PoseStamped std_msgs/Header header, Pose pose
geometry_msgs/PoseWithCovarianceStamped std_msgs/Header header, PoseWithCovariance pose
geometry_msgs/TwistStamped std_msgs/Header header, Twist twist
geometry_msgs/TwistWithCovarianceStamped std_msgs/Header header, TwistWithCovariance twist
geometry_msgs/AccelStamped std_msgs/Header header, Accel accel
geometry_msgs/AccelWithCovarianceStamped std_msgs/Header header, AccelWithCovariance accel
geometry_msgs/WrenchStamped std_msgs/Header header, Wrench wrench
geometry_msgs/TransformStamped std_msgs/Header header, string child_frame_id, Transform transform
geometry_msgs/PolygonStamped std_msgs/Header header, Polygon polygon
sensor_msgs/Imu std_msgs/Header header, geometry_msgs/Quaternion orientation, float64[9] orientation_covariance, \
geometry_msgs/Vector3 angular_velocity, float64[9] angular_velocity_covariance, \
geometry_msgs/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance
sensor_msgs/NavSatStatus int8 status, uint16 service
sensor_msgs/NavSatFix std_msgs/Header header, NavSatStatus status, float64 latitude, float64 longitude, \
float64 altitude, float64[9] position_covariance, uint8 position_covariance_type
sensor_msgs/JointState std_msgs/Header header, string[] name, float64[] position, float64[] velocity, float64[] effort
sensor_msgs/MagneticField std_msgs/Header header, geometry_msgs/Vector3 magnetic_field, \
float64[9] magnetic_field_covariance
sensor_msgs/FluidPressure std_msgs/Header header, float64 fluid_pressure, float64 variance
sensor_msgs/Temperature std_msgs/Header header, float64 temperature, float64 variance
nav_msgs/Odometry std_msgs/Header header, string child_frame_id, geometry_msgs/PoseWithCovariance pose, \
geometry_msgs/TwistWithCovariance twist
nav_msgs/Path std_msgs/Header header, geometry_msgs/PoseStamped[] poses
diagnostic_msgs/KeyValue string key, string value
diagnostic_msgs/DiagnosticStatus byte level, string name, string message, string hardware_id, KeyValue[] values
diagnostic_msgs/DiagnosticArray std_msgs/Header header, DiagnosticStatus[] status
rosgraph_msgs/Clock builtin_interfaces/Time clock
";

/// All types of the table.
pub(super) fn definitions() -> Schema {
    let mut text = String::new();
    for line in TYPES.lines() {
        let (name, members) = line.split_once(' ').unwrap_or((line, ""));
        // Writing to a string cannot fail.
        let _ = write!(text, "MSG: {name}\n{}\n", members.replace(", ", "\n"));
    }
    let mut schema = Schema::parse_ros("", &text, false).expect("the table is tested");
    // The message before the first type has no name.
    schema.types.remove("");
    schema
}

/// A type of the table with its parts.
pub(super) fn definition(type_name: &str) -> Option<Schema> {
    let root = short(type_name);
    let schema = definitions();
    schema.types.contains_key(&root).then_some(Schema { root, ..schema })
}
