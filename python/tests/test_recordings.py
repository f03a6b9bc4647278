"""The readers of recordings against the readers of others: the same values at the same times. Files of `hydroid convert`.
Identification from sensors.
"""

import os
import subprocess
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


def converted(log, output, *options):
    program = os.environ.get("HYDROID_COMMAND")
    if not program:
        pytest.skip("no HYDROID_COMMAND")
    done = subprocess.run([program, "convert", log, *options, "-o", output], capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return output


def test_runs_in_parquet_are_those_in_csv(tmp_path):
    pandas, parquet = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.parquet")
    channels = [
        "--outputs", "u=/odom.twist.twist.linear.x [m/s],r=/odom.twist.twist.angular.z [deg/s],/imu/data.orientation.w",
        "--inputs", "/actuators.pwm_us[0],right=/actuators.pwm_us[1] [us]",
    ]  # fmt: skip
    csv = converted(FORMATS / "otter_zstd.mcap", tmp_path / "run.csv", *channels)
    headings = csv.read_text().splitlines()[0].split(",")
    values = np.genfromtxt(csv, delimiter=",", skip_header=1)
    path = converted(FORMATS / "otter_zstd.mcap", tmp_path / "run.parquet", *channels)
    table = parquet.ParquetFile(path, page_checksum_verification=True).read()
    units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
    names = ["t", "u", "r", "/imu/data.orientation.w", "/actuators.pwm_us[0]", "right"]
    assert table.column_names == names
    assert [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units)] == headings
    assert set(map(str, table.schema.types)) == {"double"}
    read = pandas.read_parquet(path)
    assert list(read.columns) == names
    for name, column in zip(names, values.T, strict=True):
        np.testing.assert_array_equal(table[name].to_numpy(), column)
        np.testing.assert_array_equal(read[name], column)
        assert table[name].null_count == np.isnan(column).sum()
    assert table["right"].null_count > 0


def test_long_logs_in_parquet(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows, random = 150_000, np.random.default_rng(1)
    u, v = random.normal(size=rows), np.where(np.arange(rows) // 1000 % 3 == 0, np.nan, random.normal(size=rows))
    log = hydroid.Log({"t [s]": 0.02 * np.arange(rows), "u [kn]": u, "v [m/s]": v, "rudder_cmd": np.full(rows, np.nan)})
    log.save(tmp_path / "log.csv")
    path = converted(tmp_path / "log.csv", tmp_path / "log.parquet", "--outputs", "u,v", "--inputs", "rudder_cmd")
    file = parquet.ParquetFile(path, page_checksum_verification=True)
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [65_536, 65_536, 18_928]
    table = file.read()
    np.testing.assert_array_equal(table["t"], log["t"])
    np.testing.assert_allclose(table["u"], u * 1852 / 3600, rtol=1e-15)
    np.testing.assert_array_equal(table["v"].to_numpy(), v)
    assert table["v"].null_count == np.isnan(v).sum()
    assert table["rudder_cmd"].null_count == rows
    assert path.stat().st_size < 1.1 * 3 * 8 * rows


#: A boat with two thrusters, as folders of CSV files.
SENSORS = """
[log]
inputs = ["left=(servo.pwm_left - 1500) / 4", "right=(servo.pwm_right - 1500) / 4"]
dt = 0.2

[log.sensors]
latitude = "gnss.lat"
longitude = "gnss.lon"
speed = "gnss.sog"
course = "gnss.cog"
heading = "compass.heading"
antenna_m = [-0.45, 0.0, -0.6]

[split]
test = ["run5"]

[identify]
horizon = "2s"
seed = 3
"""


def beginning(source, folder, seconds=40):
    """The first seconds of a recording, with a fifth of its measurements, so that the computation is short."""
    folder.mkdir()
    for file in source.glob("*.csv"):
        header, *rows = file.read_text().splitlines()
        times = np.array([row.split(",")[0].rstrip("Z") for row in rows], dtype="datetime64[ms]")
        kept = np.count_nonzero(times < times[0] + np.timedelta64(seconds, "s"))
        thinned = rows[:kept] if file.stem == "servo" else rows[:kept:5]
        (folder / file.name).write_text("\n".join([header, *thinned]) + "\n")


def test_recordings_are_identified_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for run in (1, 3, 5):
        beginning(FORMATS.parent / "otter" / "field" / f"run{run}", tmp_path / f"run{run}")
    (tmp_path / "boat.toml").write_text(SENSORS)
    channels = {"outputs": "u,v,r", "inputs": "left,right"}

    told = []
    tables = hydroid.read_logs(["run1", "run3", "run5"], config="boat.toml", progress=told.append)
    assert tables[0].columns[:6] == ["t", "u", "v", "r", "left", "right"]
    assert told == sorted(told) and 0.0 <= told[0] and told[-1] <= 1.0 and len(told) > 3
    # The delay and the misalignment are those of all of them.
    alone = hydroid.read_log("run5", config="boat.toml")
    assert len(alone) == len(tables[2]) and np.abs(alone["v"] - tables[2]["v"]).max() > 1e-3

    # Files are read in the same way, also the test run that the configuration names.
    found = hydroid.identify(["run1", "run3"], config="boat.toml", methods="sindy", seed=4)
    model = found.models["sindy"]
    of_tables = hydroid.identify(tables[:2], test=tables[2], **channels, methods="sindy", horizon="2s", seed=4)
    assert model.equations() == of_tables.models["sindy"].equations()
    errors = found.judgement["sindy"].test
    np.testing.assert_allclose(errors.rmse, of_tables.judgement["sindy"].test.rmse, rtol=1e-12)

    # The model reads a further recording with what it knows of the sensors of its training: nearly the velocities of all
    # recordings together, without another search.
    judged = hydroid.evaluate(model, "run5", horizon="2s").rmse
    together = hydroid.evaluate(model, tables[2], horizon="2s", **channels).rmse
    by_itself = hydroid.evaluate(model, alone, horizon="2s", **channels).rmse
    np.testing.assert_allclose(judged, together, rtol=0.05)
    assert np.abs(by_itself / together - 1.0).max() > 0.1
    with pytest.raises(ValueError, match="give the path of the recording, or name the outputs and inputs"):
        hydroid.evaluate(model, alone, horizon="2s")

    command = os.environ.get("HYDROID_COMMAND")
    if command:
        run = [command, "identify", "run1", "run3", "-c", "boat.toml", "--methods", "sindy", "--seed", "4", "-o", "out", "-q"]
        assert subprocess.run(run).returncode in (0, 1)
        assert (tmp_path / "out" / "sindy.safetensors").read_bytes() == model.to_bytes()
