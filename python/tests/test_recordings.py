"""The readers of recordings against the readers of others: the same values at the same times."""

import os
from pathlib import Path

import numpy as np
import pytest

import hydroid

DATA = os.environ.get("HYDROID_DATA")
pytestmark = [
    pytest.mark.skipif(not DATA, reason="skipped: no HYDROID_DATA"),
    # The files have damaged places, which are stated.
    pytest.mark.filterwarnings("ignore::hydroid.LogWarning"),
]
FORMATS = Path(DATA or ".") / "fleet" / "formats"


def ours(folder, path, columns):
    """Times since the first row and columns of one topic."""
    config = folder / "hydroid.toml"
    outputs = ", ".join(f'"c{i}={column}"' for i, column in enumerate(columns))
    config.write_text(f'[log]\noutputs = [{outputs}]\ninputs = ["none"]\n')
    log = hydroid.read_log(path, config=config)
    return np.column_stack([log["t"], *(log[f"c{i}"] for i in range(len(columns)))])


def theirs(rows):
    """Times [ns] and values of the other reader, with times [s] since the first row."""
    rows = sorted(rows, key=lambda row: row[0])
    t = np.array([row[0] - rows[0][0] for row in rows]) * 1e-9
    return np.column_stack([t, np.array([row[1:] for row in rows], dtype=float)])


def same(found, expected):
    assert found.shape == expected.shape
    np.testing.assert_allclose(found[:, 0], expected[:, 0], atol=1e-6)
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], rtol=1e-12, atol=1e-12)


def radians(field, value):
    return np.radians(value) if field in ("Lat", "Lng", "latitude_deg") else value


def ns(stamp):
    return stamp.sec * 10**9 + getattr(stamp, "nanosec", 0)


TOPICS = {
    "/odom": (
        ["pose.pose.position.x", "twist.twist.linear.y", "twist.twist.angular.z", "pose.covariance[7]"],
        lambda m: (m.pose.pose.position.x, m.twist.twist.linear.y, m.twist.twist.angular.z, m.pose.covariance[7]),
    ),
    "/imu/data": (
        ["angular_velocity.z", "linear_acceleration.x", "orientation.w"],
        lambda m: (m.angular_velocity.z, m.linear_acceleration.x, m.orientation.w),
    ),
    "/fix": (["latitude", "longitude", "status.status"], lambda m: (m.latitude, m.longitude, m.status.status)),
    "/actuators": (["pwm_us[0]", "pwm_us[1]", "battery_v"], lambda m: (m.pwm_us[0], m.pwm_us[1], m.battery_v)),
}


@pytest.mark.parametrize("topic", TOPICS)
@pytest.mark.parametrize("name", ["otter_zstd.mcap", "otter_lz4.mcap"])
def test_mcap(tmp_path, name, topic):
    read = pytest.importorskip("mcap_ros2.reader").read_ros2_messages
    fields, values = TOPICS[topic]
    rows = [
        (ns(m.ros_msg.header.stamp), *values(m.ros_msg)) for m in read(str(FORMATS / name), topics=[topic])
    ]
    same(ours(tmp_path, FORMATS / name, [f"{topic}.{field}" for field in fields]), theirs(rows))


@pytest.mark.parametrize("topic", TOPICS)
@pytest.mark.parametrize("name", ["otter_ros1.bag", "otter_ros2_sqlite"])
def test_bags(tmp_path, name, topic):
    reader = pytest.importorskip("rosbags.highlevel").AnyReader
    fields, values = TOPICS[topic]
    with reader([FORMATS / name]) as bag:
        connections = [c for c in bag.connections if c.topic == topic]
        messages = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(connections=connections)]
    rows = [(ns(m.header.stamp), *values(m)) for m in messages]
    same(ours(tmp_path, FORMATS / name, [f"{topic}.{field}" for field in fields]), theirs(rows))


@pytest.mark.parametrize(
    ("dataset", "fields"),
    [
        ("sensor_combined", ["gyro_rad[2]", "accelerometer_m_s2[0]"]),
        ("sensor_gps", ["latitude_deg", "vel_m_s", "fix_type"]),
        ("vehicle_local_position", ["x", "vy", "heading"]),
        ("actuator_outputs", ["output[0]", "output[1]"]),
    ],
)
def test_ulog(tmp_path, dataset, fields):
    data = pytest.importorskip("pyulog").ULog(str(FORMATS / "otter.ulg")).get_dataset(dataset).data
    rows = zip(data["timestamp"].astype(object) * 1000, *(radians(field, data[field]) for field in fields))
    same(ours(tmp_path, FORMATS / "otter.ulg", [f"{dataset}.{field}" for field in fields]), theirs(list(rows)))


@pytest.mark.parametrize(
    ("message", "fields"),
    [("IMU", ["GyrZ", "AccX"]), ("GPS", ["Lat", "Lng", "Spd"]), ("XKF1", ["VN", "PE"]), ("RCOU", ["C1", "C3"])],
)
def test_dataflash(tmp_path, message, fields):
    reader = pytest.importorskip("pymavlink.DFReader").DFReader_binary(str(FORMATS / "otter.BIN"))
    rows = []
    # Its search by type ends at the rubbish in the file.
    while (found := reader.recv_msg()) is not None:
        if found.get_type() == message:
            values = {field: getattr(found, field) for field in fields}
            rows.append((found.TimeUS * 1000, *(radians(field, value) for field, value in values.items())))
    same(ours(tmp_path, FORMATS / "otter.BIN", [f"{message}.{field}" for field in fields]), theirs(rows))


@pytest.mark.parametrize("codec", ["zstd", "snappy"])
def test_parquet(tmp_path, codec):
    table = pytest.importorskip("pyarrow.parquet").read_table(FORMATS / "parquet" / f"otter_imu_{codec}.parquet")
    columns = [name for name in table.column_names if name != "time"]
    stamps = table["time"].cast("int64").to_pylist()
    rows = list(zip(stamps, *(table[name].to_pylist() for name in columns)))
    same(ours(tmp_path, FORMATS / "parquet" / f"otter_imu_{codec}.parquet", columns), theirs(rows))


def test_nmea(tmp_path):
    pynmea2 = pytest.importorskip("pynmea2")
    rows = []
    for line in (FORMATS / "tanker.nmea").read_bytes().split(b"\r\n"):
        try:
            stamp, sentence = line.decode("ascii").split(" ", 1)
            found = pynmea2.parse(sentence, check=True)
        except (ValueError, pynmea2.ParseError):
            continue
        if getattr(found, "sentence_type", None) == "HDT":
            rows.append((np.datetime64(stamp.rstrip("Z"), "ns").astype(int).item(), np.radians(float(found.heading))))
    same(ours(tmp_path, FORMATS / "tanker.nmea", ["HDT.heading"]), theirs(rows))
