"""Behaviour of the simulated boat, seen through a second MAVLink connection. Most tests advance it without waiting."""

import itertools
import math
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from boat import AUTO, GUIDED, HOLD, LOITER, MANUAL, RTL, Boat

RATE, FRAME_BODY, FRAME_LOCAL = 0x5E7, mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_LOCAL_NED
VELOCITY = 0xDE7  # mask of velocity alone; RATE is that of velocity and yaw rate


class Station:
    """A ground station with its boat, which advances only with the station."""

    def __init__(self, system=255, port=0, **options):
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=system, dialect="ardupilotmega")
        self.boat = Boat(self.link.port.getsockname(), **options)
        self.messages, self.bad = [], 0
        self.run(0.5)

    def close(self):
        self.boat.stop()
        self.link.close()

    def drain(self):
        while message := self.link.recv_msg():
            if message.get_type() == "BAD_DATA":
                self.bad += 1
            elif message.get_srcSystem() == 1:
                self.messages.append(message)

    def run(self, seconds, each=None):
        """Advances the boat; `each` is called at 10 Hz."""
        for _ in range(round(seconds / 0.1)):
            if each:
                each()
            self.boat.run(0.1)
            self.drain()

    def take(self, kind):
        """All messages of a kind since the last call."""
        found = [message for message in self.messages if message.get_type() == kind]
        self.messages = [message for message in self.messages if message.get_type() != kind]
        return found

    def texts(self):
        return [message.text for message in self.take("STATUSTEXT")]

    def command(self, command, *parameters):
        """Result of a command."""
        self.link.mav.command_long_send(1, 1, command, 0, *parameters, *[0] * (7 - len(parameters)))
        self.run(0.1)
        return self.take("COMMAND_ACK")[-1].result

    def mode(self, mode):
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode)

    def arm(self, armed=1, magic=0):
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, armed, magic)

    def interval(self, name, hertz):
        message = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        return self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, round(1e6 / hertz))

    def override(self, steering=65535, throttle=65535, mode_switch=65535):
        rest = [65535] * 4
        self.link.mav.rc_channels_override_send(1, 1, steering, 65535, throttle, *rest, mode_switch)

    def velocity(self, frame, mask, ahead, rate=0.0):
        self.link.mav.set_position_target_local_ned_send(0, 1, 1, frame, mask, 0, 0, 0, ahead, 0, 0, 0, 0, 0, 0, rate)

    def parameter(self, name, value=None):
        if value is None:
            self.link.mav.param_request_read_send(1, 1, name.encode(), -1)
        else:
            self.link.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        self.run(0.1)
        return next((message for message in self.take("PARAM_VALUE") if message.param_id == name), None)

    def exchange_time(self):
        """The answer to a TIMESYNC, in seconds."""
        self.link.mav.timesync_send(0, 4711)
        self.run(0.1)
        answers = [message for message in self.take("TIMESYNC") if message.tc1 != 0]
        assert [message.ts1 for message in answers] == [4711]
        return answers[0].tc1 / 1e9


@pytest.fixture
def station(request):
    station = Station(**getattr(request, "param", {}))
    yield station
    station.close()


def with_options(**options):
    return pytest.mark.parametrize("station", [options], indirect=True)


def test_all_messages_arrive_with_units_of_ardupilot(station):
    station.run(10.0)
    boat, sensors = station.boat, station.boat.sensors
    expected = "HEARTBEAT RAW_IMU SYS_STATUS GPS_RAW_INT SERVO_OUTPUT_RAW RC_CHANNELS GLOBAL_POSITION_INT TIMESYNC"
    expected += " LOCAL_POSITION_NED ATTITUDE VFR_HUD SYSTEM_TIME EKF_STATUS_REPORT"
    assert {message.get_type() for message in station.messages} == set(expected.split())
    last = {message.get_type(): message for message in station.messages}
    beat = last["HEARTBEAT"]
    assert (beat.type, beat.autopilot, beat.base_mode, beat.custom_mode) == (11, 3, 65, MANUAL)
    assert abs(len(station.take("ATTITUDE")) - 11) <= 1
    assert abs(last["ATTITUDE"].time_boot_ms - (100e3 + 1e3 * boat.now)) < 1100
    assert abs(last["GPS_RAW_INT"].lat / 1e7 - 63.44) < 5e-5 and last["GPS_RAW_INT"].fix_type == 3
    assert abs(last["RAW_IMU"].zacc + 1000) < 30
    assert last["EKF_STATUS_REPORT"].flags == 831
    assert last["SYSTEM_TIME"].time_unix_usec > 1.7e15
    assert last["SERVO_OUTPUT_RAW"].servo1_raw == last["SERVO_OUTPUT_RAW"].servo3_raw == 1500
    assert last["RC_CHANNELS"].chan1_raw == 1500 and last["RC_CHANNELS"].chancount == 8
    place = last["GLOBAL_POSITION_INT"]
    assert abs((place.lat / 1e7 - 63.44) * 111319 - sensors.north) < 0.3
    assert place.hdg == int(100 * math.degrees(last["ATTITUDE"].yaw)) % 36000


def test_rates(station):
    assert station.interval("ATTITUDE", 40) == mavlink.MAV_RESULT_ACCEPTED
    assert station.interval("GPS_RAW_INT", 20) == mavlink.MAV_RESULT_ACCEPTED
    assert station.interval("ATTITUDE", 50) == mavlink.MAV_RESULT_DENIED  # above 0.8 SCHED_LOOP_RATE
    assert station.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 9999, 1e5) == mavlink.MAV_RESULT_DENIED
    station.messages.clear()
    station.run(5.0)
    stamps = [message.time_boot_ms for message in station.take("ATTITUDE")]
    assert abs(len(stamps) - 200) <= 2 and {b - a for a, b in itertools.pairwise(stamps)} <= {19, 20, 21, 39, 40, 41}
    assert abs(len(station.take("GPS_RAW_INT")) - 25) <= 1  # a fix is sent once
    station.messages.clear()
    station.link.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    station.run(5.0)
    assert abs(len(station.take("ATTITUDE")) - 20) <= 2 and abs(len(station.take("VFR_HUD")) - 20) <= 2
    station.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_VFR_HUD, -1)
    station.messages.clear()
    station.run(3.0)
    assert not station.take("VFR_HUD") and len(station.take("HEARTBEAT")) == 3
    assert station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION) == 0
    assert abs(station.take("HOME_POSITION")[0].latitude - 634400000) < 300
    assert station.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION) == mavlink.MAV_RESULT_UNSUPPORTED


def test_sensors_have_delay_and_errors(station):
    station.boat.armed = True
    station.boat.sticks(0.0, 0.6)
    station.interval("GPS_RAW_INT", 10)
    station.run(20.0)
    delays, errors = [], []
    for _ in range(150):
        while station.boat.sensors.fix_time != station.boat.now:
            station.boat.run(0.02)
        slow = station.boat.sensors.errors["north"]
        now, fix = station.boat.truth, station.boat.sensors.fix
        delays.append((now.north - (fix[0] - slow)) / now.velocity_north)
        errors.append(station.boat.sensors.north - now.north - slow)
        station.boat.run(0.02)
    assert abs(statistics.mean(delays) - 0.2) < 0.03
    assert max(map(abs, errors)) < 1e-9  # the estimate of the EKF has no delay
    assert statistics.stdev(delays) * now.velocity_north > 0.05  # white noise of the fixes [m]


def test_override_moves_the_boat_only_from_the_ground_station(station):
    assert station.arm() == mavlink.MAV_RESULT_ACCEPTED and "Throttle armed" in station.texts()
    station.link.mav.srcSystem = 42
    station.run(5.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.u == 0.0 and station.boat.truth.pulses == (1500, 1500)
    station.link.mav.srcSystem = 255
    station.run(8.0, lambda: station.override(1560, 1800))
    assert station.take("RC_CHANNELS")[-1].chan3_raw == 1800
    truth = station.boat.truth
    assert truth.u > 1.0 and truth.r > 0.02 and truth.pulses[0] > truth.pulses[1]
    # 65535 leaves the throttle as it is; the last override holds for RC_OVERRIDE_TIME, then the stick returns.
    station.run(2.0, lambda: station.override(steering=1500))
    assert station.boat.truth.throttle > 0.5
    station.run(1.5)
    assert station.boat.truth.throttle < 0.5
    station.run(8.0)
    assert station.boat.truth.pulses == (1500, 1500) and station.boat.truth.u < 0.2
    station.override(throttle=1800)
    station.run(1.0)
    station.override(throttle=0)  # releases
    station.run(0.1)
    assert station.boat._radio[2] == 1500


@with_options(release="4.6")
def test_identifier_of_the_ground_station_is_a_parameter(station):
    assert station.parameter("MAV_GCS_SYSID") is None
    assert station.parameter("SYSID_MYGCS").param_value == 255
    assert station.parameter("SYSID_MYGCS", 42).param_value == 42
    station.arm(magic=21196)
    station.run(1.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.throttle == 0.0
    station.link.mav.srcSystem = 42
    station.run(1.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.throttle > 0.5


def test_who_may_command(station):
    # A range of identifiers of ground stations.
    station.parameter("MAV_GCS_SYSID_HI", 0)
    station.parameter("MAV_GCS_SYSID", 200)
    station.parameter("MAV_GCS_SYSID_HI", 254)
    station.arm()
    for system, has_effect in ((199, False), (220, True), (255, False)):
        station.link.mav.srcSystem = system
        station.run(0.5, lambda: station.override(1500, 1800))
        assert (station.boat.truth.throttle > 0.1) == has_effect
        station.run(4.0)
    # Set-points, commands and SET_MODE (without an answer) are taken from anybody, unless that is forbidden.
    station.link.mav.set_mode_send(1, 1, HOLD)
    station.run(0.1)
    assert station.boat.truth.mode == HOLD and not station.take("COMMAND_ACK")
    station.link.mav.command_long_send(2, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, MANUAL, *[0] * 5)  # another vehicle
    station.parameter("MAV_OPTIONS", 1)
    station.link.mav.set_mode_send(1, 1, MANUAL)
    station.run(0.1)
    assert station.boat.truth.mode == HOLD
    # A message with the identifiers of the autopilot counts as its own, another component of the vehicle does not.
    for component, mode in ((1, HOLD), (191, MANUAL)):
        station.link.mav.srcSystem, station.link.mav.srcComponent = 1, component
        station.link.mav.set_mode_send(1, 1, MANUAL)
        station.run(0.1)
        assert station.boat.truth.mode == mode


def test_manual_control_and_steering_astern(station):
    station.arm()
    station.run(6.0, lambda: station.link.mav.manual_control_send(1, 0, 400, -700, 0, 0))
    truth = station.boat.truth
    assert truth.u < -0.3 and truth.steering < 0  # the steering is reversed astern (PILOT_STEER_TYPE 0)
    station.parameter("PILOT_STEER_TYPE", 3)
    station.run(1.0, lambda: station.link.mav.manual_control_send(1, 0, 400, -700, 0, 0))
    assert station.boat.truth.steering > 0
    station.run(5.0, lambda: station.link.mav.manual_control_send(2, 0, 0, 900, 0, 0))  # another vehicle
    assert station.boat.truth.throttle == 0


def test_pilot_takes_over(station):
    station.arm()
    station.run(5.0, lambda: station.override(1500, 1800))
    station.boat.sticks(0.0, -0.5)  # the stick has no effect while the override is in force
    station.run(1.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.throttle > 0.5
    station.take("HEARTBEAT")
    station.boat.mode_switch(HOLD)
    station.run(0.4, lambda: station.override(1500, 1800))
    assert station.take("HEARTBEAT")[-1].custom_mode == HOLD  # at once, not after a second
    station.run(6.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.pulses == (1500, 1500) and station.boat.truth.u < 0.4
    station.boat.mode_switch(MANUAL)
    station.boat.allow_overrides(False)
    station.run(3.0, lambda: station.override(1500, 1800))
    assert station.boat.truth.throttle < -0.3


def test_guided_reverses_in_the_body_frame_with_a_yaw_rate(station):
    station.arm()
    station.velocity(FRAME_BODY, RATE, -0.6)
    station.run(3.0)
    assert station.boat.truth.u == 0.0  # ignored outside GUIDED
    assert station.mode(GUIDED) == mavlink.MAV_RESULT_ACCEPTED
    station.run(10.0, lambda: station.velocity(FRAME_BODY, RATE, -0.6, 0.1))
    truth = station.boat.truth
    assert truth.u == pytest.approx(-0.6, abs=0.15) and truth.r == pytest.approx(0.1, abs=0.03)
    # The time-out stops the boat.
    station.texts()
    station.run(3.5)
    assert "target not received last 3secs, stopping" in station.texts()
    station.run(12.0)
    assert abs(station.boat.truth.u) < 0.15 and abs(station.boat.truth.r) < 0.05
    # A velocity alone turns the boat and drives it ahead.
    speeds = []

    def drive():
        station.velocity(FRAME_LOCAL, VELOCITY, -0.8)
        speeds.append(station.boat.truth.u)

    station.run(25.0, drive)
    truth = station.boat.truth
    assert min(speeds) > -0.3 and truth.u > 0.6 and truth.velocity_north < -0.6
    # Ignored without words: yaw with yaw rate, frame 12; with words: acceleration.
    goal = station.boat._goal
    station.velocity(FRAME_BODY, 0x1E7, 1.0)
    station.velocity(mavlink.MAV_FRAME_BODY_FRD, RATE, 1.0)
    station.run(0.1)
    assert station.boat._goal == goal and not station.texts()
    station.velocity(FRAME_BODY, 0x427, 1.0)
    station.run(0.1)
    assert "".join(station.texts()) == "Ignoring SET_POSITION_TARGET_LOCAL_NED; set ACC_IGNORE in mask"
    assert station.boat._goal == goal


@with_options(current=(0.1, -0.2), gusts=2.0)
def test_positions(station):
    station.arm(magic=2989)
    station.mode(GUIDED)
    lat, lon = round(634400000 + 20 / 0.0111318845), 103600000
    station.link.mav.set_position_target_global_int_send(0, 1, 1, 6, 3580, lat, lon, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    station.run(40.0)
    truth = station.boat.truth
    assert math.hypot(truth.north - 20, truth.east) < 5
    station.run(40.0)  # it holds the place in the current
    truth = station.boat.truth
    assert math.hypot(truth.north - 20, truth.east) < 6
    assert station.mode(AUTO) == mavlink.MAV_RESULT_FAILED and "Flight mode change failed" in station.texts()
    station.boat.mission = [(20.0, 15.0), (0.0, 15.0)]
    station.boat.mode_switch(AUTO)
    station.run(50.0)
    truth = station.boat.truth
    assert station.boat.truth.mode == AUTO and math.hypot(truth.north, truth.east - 15) < 6
    assert station.mode(RTL) == mavlink.MAV_RESULT_ACCEPTED
    station.run(30.0)
    assert math.hypot(station.boat.truth.north, station.boat.truth.east) < 6
    assert station.mode(LOITER) == mavlink.MAV_RESULT_ACCEPTED


def test_arming_is_refused_with_a_reason(station):
    station.boat.faults.prearm = "Compass not healthy"
    assert station.arm() == mavlink.MAV_RESULT_FAILED and station.texts() == ["Arm: Compass not healthy"]
    assert station.command(mavlink.MAV_CMD_RUN_PREARM_CHECKS) == mavlink.MAV_RESULT_ACCEPTED
    assert station.texts() == ["PreArm: Compass not healthy"]
    station.boat.faults.prearm = ""
    station.boat.sticks(0.0, 0.5)
    station.run(0.1)
    assert station.arm() == mavlink.MAV_RESULT_FAILED and station.texts() == ["Arm: Throttle (RC3) is not neutral"]
    station.run(3.0)
    assert station.boat.truth.pulses == (1500, 1500) and station.boat.truth.u == 0.0  # disarmed: trim
    station.boat.sticks(0.0, 0.0)
    station.boat.faults.gnss_lost = True
    station.run(6.0)
    assert station.mode(GUIDED) == mavlink.MAV_RESULT_ACCEPTED  # disarmed, any mode is accepted
    assert station.arm() == mavlink.MAV_RESULT_FAILED and station.texts() == ["Arm: Need Position Estimate"]
    assert station.mode(HOLD) == 0 and station.arm() == 0
    assert station.take("EKF_STATUS_REPORT")[-1].flags == 165
    assert station.mode(GUIDED) == mavlink.MAV_RESULT_FAILED


def test_parameters(station):
    station.link.mav.param_request_list_send(1, 1)
    station.run(0.2)
    values = station.take("PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    table = {value.param_id: value.param_value for value in values}
    assert table["SERVO1_FUNCTION"] == 73 and table["RC_OVERRIDE_TIME"] == 3.0 and "SYSID_MYGCS" not in table
    assert station.parameter("RC3_TRIM").param_value == 1500
    assert station.parameter("RC3_TRIM", 1480).param_value == 1480
    assert station.parameter("NO_SUCH") is None and station.take("PARAM_ERROR")


def test_failsafes(station):
    station.arm()
    station.parameter("FS_GCS_ENABLE", 1)
    beat = (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    station.run(10.0, lambda: station.link.mav.heartbeat_send(*beat))
    assert station.boat.truth.mode == MANUAL
    station.run(6.0)
    assert station.boat.truth.mode == MANUAL
    station.run(1.5)
    assert station.boat.truth.mode == HOLD and "GCS Failsafe" in station.texts()
    assert station.take("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    station.link.mav.heartbeat_send(*beat)
    station.run(0.1)
    assert "GCS Failsafe Cleared" in station.texts() and station.boat.truth.mode == HOLD
    station.parameter("FS_GCS_ENABLE", 0)
    station.mode(MANUAL)
    # Without a receiver the last override stays in RC_CHANNELS, but the pilot's input counts as neutral.
    station.boat.faults.receiver_lost = True
    station.run(3.0, lambda: station.override(1500, 1700))
    assert station.boat.truth.throttle > 0.3
    station.run(2.0)
    assert station.boat._radio[2] == 1700 and station.boat.truth.throttle == 0.0
    station.run(2.0)
    assert station.boat.truth.mode == HOLD and "Radio Failsafe" in station.texts()
    station.boat.faults.battery_volts = 13.5
    station.run(1.0)
    assert "Battery 1 is low 13.50V used 0 mAh" in station.texts()
    assert station.take("SYS_STATUS")[-1].voltage_battery == 13500


def test_clock(station):
    first, before = station.exchange_time(), station.boat.now
    station.run(100.0)
    drift = (station.exchange_time() - first) / (station.boat.now - before) - 1.0
    assert abs(first - 100.0 - before) < 0.1 and drift == pytest.approx(20e-6, rel=0.01)
    station.boat.clock += 7.0
    assert station.exchange_time() - first == pytest.approx(station.boat.now - before + 7.0, abs=0.02)
    station.arm()
    station.boat.reboot()
    station.messages.clear()
    station.run(2.9)
    assert not station.messages and station.boat.truth.pulses == (0, 0)
    station.run(1.0)
    assert station.take("ATTITUDE")[-1].time_boot_ms < 4500
    assert station.take("HEARTBEAT")[-1].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED == 0


def test_faults_of_sensors(station):
    station.boat.armed = True
    station.boat.sticks(0.5, 0.0)
    station.interval("ATTITUDE", 10)
    station.boat.faults.compass_frozen = True
    station.run(5.0)
    turns = station.take("ATTITUDE")
    assert len({message.yaw for message in turns[-30:]}) == 1 and turns[-1].yawspeed > 0.1
    station.boat.faults.compass_frozen = False
    station.boat.sticks(0.0, 0.0)
    station.boat.faults.gnss_jump = (30.0, 0.0)
    station.run(5.0)
    fix, place = station.take("GPS_RAW_INT")[-1], station.take("GLOBAL_POSITION_INT")[-1]
    assert (fix.lat - place.lat) * 0.0111 > 25  # the EKF rejects the jump at first
    assert station.take("EKF_STATUS_REPORT")[-1].flags & 32768
    station.run(8.0)
    fix, place = station.take("GPS_RAW_INT")[-1], station.take("GLOBAL_POSITION_INT")[-1]
    assert abs(fix.lat - place.lat) * 0.0111 < 2


def test_faults_of_the_link(station):
    station.interval("ATTITUDE", 25)

    def count(**faults):
        for name, value in faults.items():
            setattr(station.boat.faults, name, value)
        station.messages.clear()
        station.run(20.0)
        for name in faults:
            setattr(station.boat.faults, name, 0.0)
        station.run(1.0)
        return [message.time_boot_ms for message in station.take("ATTITUDE")]

    assert len(count()) in range(524, 528)
    assert 350 < len(count(loss=0.3)) < 450
    assert 600 < len(count(duplication=0.3)) < 750
    stamps = count(reordering=0.3)
    assert len(stamps) in range(524, 528) and stamps != sorted(stamps)
    bad = station.bad
    assert len(count(corruption=0.3)) < 450 and station.bad > bad
    station.boat.faults.silent_until = station.boat.now + 5.0
    station.messages.clear()
    station.run(4.9)
    assert not station.messages
    station.run(1.0)
    assert station.messages
    station.boat.faults.delay = 0.5
    station.run(1.0)
    assert station.take("ATTITUDE")[-1].time_boot_ms < 1e5 + 1e3 * (station.boat.now - 0.45)


def test_seed_determines_everything():
    def run(seed):
        station = Station(seed=seed, current=(0.1, 0.2), gusts=3.0)
        station.boat.faults.loss = 0.2
        station.boat.armed = True
        station.boat.sticks(0.2, 0.5)
        station.run(20.0)
        result = station.boat.truth, [message.to_dict() for message in station.messages]
        station.close()
        return result

    assert run(1) == run(1)
    assert run(1) != run(2)


@with_options(current=(0.3, -0.1))
def test_plant(station):
    boat = station.boat
    boat.run(30.0)
    truth = boat.truth
    assert (truth.velocity_north, truth.velocity_east) == pytest.approx((0.3, -0.1)) and truth.u == 0.0
    boat.armed = True
    boat.sticks(0.0, 1.0)
    boat.run(60.0)
    ahead = boat.truth
    assert 2.5 < ahead.u < 3.0 and ahead.shafts == pytest.approx((100, 100))
    boat.sticks(0.0, -1.0)
    boat.run(60.0)
    assert -ahead.u < boat.truth.u < -1.8  # weaker astern
    boat.sticks(0.0, 0.1)
    boat.run(60.0)
    assert 0 < boat.truth.throttle < 0.05 and boat.truth.u < 0.05  # dead zone of the stick, dead band of the thruster


def test_threads_in_fast_real_time():
    link = mavutil.mavlink_connection("udpin:127.0.0.1:0", source_system=255, dialect="ardupilotmega")
    boat = Boat(link.port.getsockname(), speed=20.0).start()
    boat.armed = True
    started, stamps = time.monotonic(), []
    while time.monotonic() - started < 2.0:
        if message := link.recv_match(type="ATTITUDE", blocking=True, timeout=0.2):
            stamps.append(message.time_boot_ms / 1e3)
            link.mav.rc_channels_override_send(1, 1, 1500, 65535, 1700, *[65535] * 5)
    boat.stop()
    link.close()
    assert 5 < stamps[-1] - stamps[0] < 42 and boat.truth.u > 0.5  # a busy computer falls behind


def test_command_line():
    program = [sys.executable, Path(__file__).with_name("boat.py"), "127.0.0.1:9", "--speed", "20", "--duration", "30"]
    done = subprocess.run([*program, "--armed", "--pilot"], capture_output=True, text=True, timeout=20, check=True)
    assert len(done.stdout.splitlines()) >= 2 and "MANUAL" in done.stdout and "armed" in done.stdout
