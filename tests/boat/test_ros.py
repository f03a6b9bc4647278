"""`hydroid-ros` with a boat in the graph of ROS 2, by another implementation of DDS."""

import math
import os
import pathlib
import subprocess
import time

import numpy as np
import pytest
from conftest import COMMAND, Hydroid

pytest.importorskip("cyclonedds", reason="skipped: no cyclonedds")

from mcap.reader import make_reader  # noqa: E402
from mcap_ros2.decoder import DecoderFactory  # noqa: E402
from ros_boat import Boat  # noqa: E402
from ros_messages import DiagnosticArray, Float64, Odometry, Path, PoseWithCovarianceStamped  # noqa: E402

PROGRAM = os.environ.get("HYDROID_ROS_COMMAND", str(pathlib.Path(COMMAND).with_name("hydroid-ros")))
DOMAINS = iter(range(60, 100))


@pytest.fixture
def graph(tmp_path):
    """Makes a boat in a graph of its own, and hydroid-ros beside it."""
    running = []

    def make(*arguments, config=lambda text: text, words=(), **water):
        domain = next(DOMAINS)
        boat = Boat(domain, **water)
        example = subprocess.run([PROGRAM, "--print-config"], check=True, capture_output=True, text=True).stdout
        (tmp_path / "boat.toml").write_text(config(example))
        environment = {"ROS_DOMAIN_ID": str(domain), "ROS_LOCALHOST_ONLY": "1"}
        hydroid = Hydroid(tmp_path, *arguments, program=(PROGRAM,), words=words, **environment)
        running.extend([hydroid, boat])
        boat.start()
        return boat, hydroid

    yield make
    for one in running:
        one.stop()


def newest(reader, seconds, holds=lambda _: True):
    """The newest message for which a condition holds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        fits = [message for message in reader.take(1000) if holds(message)]
        if fits:
            return fits[-1]
        time.sleep(0.02)
    raise AssertionError("no such message")


def pose(odometry):
    """North, east and heading of a pose with axes to the east and north."""
    at = odometry.pose.pose if hasattr(odometry.pose, "pose") else odometry.pose
    yaw = 2.0 * math.atan2(at.orientation.z, at.orientation.w)
    return at.position.y, at.position.x, math.remainder(math.pi / 2 - yaw, math.tau)


def test_estimate_diagnostics_and_recording(graph, tmp_path):
    boat, hydroid = graph("new", current=(0.1, 0.05))
    estimates = boat.graph.subscription("/hydroid/estimate", Odometry)
    diagnostics = boat.graph.subscription("/diagnostics", DiagnosticArray)
    other = boat.graph.publisher("/thrusters/left", Float64)
    hydroid.wait(lambda s: s["motion"], 20, "the motion")
    # Somebody else steers: hydroid follows.
    end = time.monotonic() + 8.0
    while time.monotonic() < end:
        other.write(Float64(0.8))
        time.sleep(0.1)
    estimate = newest(estimates, 5.0)
    north, east, heading, *_ = boat.plant.state
    found = pose(estimate)
    assert math.hypot(found[0] - north, found[1] - east) < 1.0, "the position from the first fix"
    assert abs(math.remainder(found[2] - heading, math.tau)) < 0.1
    # Positive to port.
    assert estimate.twist.twist.angular.z == pytest.approx(-boat.plant.state[5], abs=0.1)
    assert estimate.header.frame_id == "hydroid_map" and estimate.child_frame_id == "base_link"
    assert 0.0 < estimate.pose.covariance[0] < 4.0
    age = time.time() - estimate.header.stamp.sec - 1e-9 * estimate.header.stamp.nanosec
    assert abs(age) < 0.5

    statuses = {one.name: one for one in newest(diagnostics, 5.0).status}
    assert statuses["hydroid: topics"].level == 0
    assert statuses["hydroid: sensor position"].message == "measured"
    assert statuses["hydroid: recording"].message == "recording"
    sensors = {sensor["name"]: sensor for sensor in hydroid.state["sensors"]}
    assert sensors["position"]["rate_hz"] == pytest.approx(5.0, rel=0.2)
    assert sensors["heading"]["rate_hz"] == pytest.approx(50.0, rel=0.2)
    assert hydroid.stop() == 130

    # The recording has the messages as they were sent, by their own definitions.
    (path,) = (tmp_path / "live").glob("*.mcap")
    with open(path, "rb") as file:
        topics = {}
        for schema, channel, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            topics.setdefault((channel.topic, schema.name), []).append(message)
    fixes = topics["/gps/fix", "sensor_msgs/msg/NavSatFix"]
    assert fixes[-1].header.frame_id == "base_link" and fixes[-1].latitude == pytest.approx(63.44, abs=0.01)
    assert any(message.data == 0.8 for message in topics["/thrusters/left", "std_msgs/msg/Float64"])
    assert any("no permission needed" in message.data for message in topics["/events", "std_msgs/msg/String"])


def test_commands_experiment_and_take_over(graph):
    boat, hydroid = graph("new", "--allow-commands", "--fence", "90", config=lambda text: text.replace("# enable =", "enable ="))
    hydroid.wait(lambda s: s["motion"] and not s["helm"]["refusals"], 20, "the preflight")
    boat.enabled = False
    hydroid.wait(lambda s: any("/hydroid_enable is false" in text for text in s["helm"]["refusals"]), 5, "the refusal")
    assert hydroid.act("experiment", name="circle")[0] == 409
    assert not boat.received, "no command without permission"
    boat.enabled = True
    hydroid.wait(lambda s: not s["helm"]["refusals"], 5, "the permission")
    assert hydroid.act("experiment", name="circle")[0] == 200
    time.sleep(6.0)
    assert hydroid.state["helm"]["state"] == "experiment", hydroid.said
    assert {side for _, side, _ in boat.received} == {"left", "right"}
    assert all(-1.0 <= value <= 1.0 for *_, value in boat.received)
    assert max(value for *_, value in boat.received) > 0.1, "it sails"

    # The permission ends: neutral commands, and none afterwards.
    boat.enabled = False
    hydroid.wait(lambda s: s["helm"]["state"] == "off", 5, "hands off")
    assert any("/hydroid_enable is false" in said["text"] for said in hydroid.said)
    time.sleep(1.0)
    assert boat.received[-1][2] == 0.0
    count = len(boat.received)
    time.sleep(1.0)
    assert len(boat.received) == count

    # Another node commands: hands off at once, without a neutral command that would disturb it.
    boat.enabled = True
    hydroid.wait(lambda s: not s["helm"]["refusals"], 5, "the permission")
    assert hydroid.act("experiment", name="circle")[0] == 200
    time.sleep(2.0)
    pilot = boat.graph.publisher("/thrusters/left", Float64)
    time.sleep(1.0)
    begun = time.time()
    pilot.write(Float64(0.123))
    hydroid.wait(lambda s: s["helm"]["state"] == "off", 5, "hands off")
    time.sleep(1.0)
    late = [order for order in boat.received if order[0] > begun + 0.3 and order[2] != 0.123]
    assert not late
    assert any("another node commands /thrusters/left" in said["text"] for said in hydroid.said)
    hydroid.wait(lambda s: any("publishes /thrusters/left" in text for text in s["helm"]["refusals"]), 5, "the refusal")


def test_names_are_remapped_and_wrong_ones_explained(graph, tmp_path):
    boat, hydroid = graph(
        "new",
        "--no-record",
        config=lambda text: text.replace("/gps/fix", "/fix").replace("/imu/data", "imu"),
        words=("--ros-args", "-r", "/fix:=/gps/fix", "-r", "imu:=/imu/data", "-r", "__ns:=/boat", "-r", "__node:=model", "-p", "fence:=55"),
    )
    estimates = boat.graph.subscription("/boat/model/estimate", Odometry)
    state = hydroid.wait(lambda s: s["motion"] and s["fence"], 20, "the motion")
    assert state["fence"]["radius"] == 55
    newest(estimates, 5.0)

    def refused(text, *words):
        (tmp_path / "wrong.toml").write_text(text)
        done = subprocess.run([PROGRAM, "new", "-c", str(tmp_path / "wrong.toml"), "--no-page", *words], capture_output=True, text=True, timeout=20)
        assert done.returncode == 2, done
        return done.stderr

    example = subprocess.run([PROGRAM, "--print-config"], check=True, capture_output=True, text=True).stdout
    assert "names no topics" in refused(example[example.index("[log]") :])
    assert "none of the common types" in refused(example.replace("std_msgs/msg/Float64", "my_msgs/msg/Thrust"))
    assert "/gps/fix.latitud" in refused(example.replace("fix.latitude", "fix.latitud"))
    assert "NAME:=VALUE" in refused(example, "--ros-args", "-r", "/odom")


def test_predictions_of_a_model(graph):
    boat, hydroid = graph("new")
    thrusters = [boat.graph.publisher(f"/thrusters/{side}", Float64) for side in ("left", "right")]

    def command(*values):
        for thruster, value in zip(thrusters, values):
            thruster.write(Float64(value))
        time.sleep(0.05)

    # Another node steers, with random thrust: a log for identification, of 100 s because 60 s have no more windows for
    # learning than a library of 26 terms needs.
    hydroid.wait(lambda s: s["motion"], 20, "the motion")
    random = np.random.default_rng(3)
    for _ in range(25):
        mean, half = random.uniform(-0.2, 0.9), random.uniform(-0.3, 0.3)
        end = time.monotonic() + 4.0
        while time.monotonic() < end:
            command(*(float(min(max(mean + half * sign, -1.0), 1.0)) for sign in (1, -1)))
    assert hydroid.act("identify")[0] == 200
    hydroid.wait(lambda s: s["offered"], 200, "a model")
    assert hydroid.act("adopt")[0] == 200
    predictions = boat.graph.subscription("/hydroid/prediction_5s", PoseWithCovarianceStamped)
    paths = boat.graph.subscription("/hydroid/predicted_path", Path)
    poses, ahead = {}, None
    end = time.monotonic() + 25.0
    while time.monotonic() < end:
        command(0.6, 0.6)
        poses[time.time()] = boat.plant.state[:3]
        if time.monotonic() < end - 8.0:
            ahead = (predictions.take(100) or [ahead])[-1]
    assert ahead, hydroid.said
    # Five seconds ahead, on a straight course.
    then = ahead.header.stamp.sec + 1e-9 * ahead.header.stamp.nanosec
    sailed = min(poses, key=lambda at: abs(at - then))
    assert abs(sailed - then) < 0.2
    assert math.dist(pose(ahead)[:2], poses[sailed][:2]) < 2.0
    assert 0.0 < ahead.pose.covariance[0] < 25.0
    path = newest(paths, 5.0)
    first, last = (one.header.stamp for one in (path.poses[0], path.poses[-1]))
    assert last.sec - first.sec == pytest.approx(10, abs=1)
    assert math.dist(pose(path.poses[0])[:2], boat.plant.state[:2]) < 2.0
