"""A simulated boat that speaks MAVLink as ArduPilot Rover does, for tests of hydroid.

Modelled are the parts of ArduPilot Rover (a boat with skid steering, releases 4.6 and 4.7) that a companion computer
meets, in a loop of 50 Hz: modes, arming, RC receiver and overrides, set-points of GUIDED, failsafes, parameters, rates
of messages, and the clock. `world.py` has the boat in the water, the sensors, and the faults of the link. Times are
simulated seconds since the start of the program. Steering and yaw rates are positive to starboard.

Not modelled: transfer of missions and fences, MAVLink signing, other modes, avoidance, and flow control of the link.
The controllers of speed, yaw rate and position are simpler than those of ArduPilot.
"""

import argparse
import collections
import math
import random
import threading
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from world import GRAVITY, NOMINAL_VOLTS, TICK, Faults, Link, Plant, Sensors, clamp, geographic, local, wrap

BOOT_TIME, GUIDED_TIMEOUT = 3.0, 3.0  # s
SYSTEM, COMPONENT = 1, 1
MANUAL, HOLD, LOITER, AUTO, RTL, GUIDED = 0, 4, 5, 10, 11, 15
MODES = {0: "MANUAL", 4: "HOLD", 5: "LOITER", 10: "AUTO", 11: "RTL", 15: "GUIDED"}
INFO, WARNING, CRITICAL = mavlink.MAV_SEVERITY_INFO, mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4  # MAV_RESULT
RECEIVER_BIT, BATTERY_BIT, PREARM_BIT = 1 << 16, 1 << 25, 1 << 28  # of SYS_STATUS
SENSOR_BITS = 0x2F | RECEIVER_BIT | 1 << 21 | BATTERY_BIT | PREARM_BIT

# Messages of the streams of REQUEST_DATA_STREAM, and intervals before a request [s].
STREAMS = {1: "RAW_IMU", 2: "SYS_STATUS GPS_RAW_INT", 3: "SERVO_OUTPUT_RAW RC_CHANNELS", 10: "ATTITUDE", 11: "VFR_HUD"}
STREAMS |= {6: "GLOBAL_POSITION_INT LOCAL_POSITION_NED", 12: "SYSTEM_TIME EKF_STATUS_REPORT"}
INTERVALS = dict.fromkeys(" ".join(STREAMS.values()).split(), 1.0) | {"HEARTBEAT": 1.0, "TIMESYNC": 10.0}
NAMES = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}"): name for name in (*INTERVALS, "HOME_POSITION")}

# Parameters by type: those that this file uses or a ground station checks, most with the defaults of ArduPilot.
PARAMETERS = {
    mavlink.MAV_PARAM_TYPE_INT8: """FRAME_CLASS 2 RCMAP_ROLL 1 RCMAP_PITCH 2 RCMAP_THROTTLE 3 RCMAP_YAW 4
        RC1_REVERSED 0 RC3_REVERSED 0 MODE_CH 8 MODE1 0 MODE2 4 MODE3 15 MODE4 10 MODE5 5 MODE6 11 PILOT_STEER_TYPE 0
        SERVO1_REVERSED 0 SERVO3_REVERSED 0 FS_ACTION 2 FS_GCS_ENABLE 0 FS_THR_ENABLE 1 BATT_FS_LOW_ACT 0 FENCE_ENABLE 0
        CRUISE_THROTTLE 58 MOT_SLEWRATE 100 STICK_MIXING 0""",
    mavlink.MAV_PARAM_TYPE_INT16: """SYSID_THISMAV 1 SYSID_MYGCS 255 SYSID_ENFORCE 0 MAV_SYSID 1 MAV_GCS_SYSID 255
        MAV_GCS_SYSID_HI 0 MAV_OPTIONS 0
        RC1_OPTION 0 RC2_OPTION 0 RC3_OPTION 0 RC4_OPTION 0
        RC1_MIN 1100 RC1_TRIM 1500 RC1_MAX 1900 RC1_DZ 30 RC3_MIN 1100 RC3_TRIM 1500 RC3_MAX 1900 RC3_DZ 30
        RC7_OPTION 46 SERVO1_MIN 1100 SERVO1_TRIM 1500 SERVO1_MAX 1900 SERVO1_FUNCTION 73 SERVO3_MIN 1100
        SERVO3_TRIM 1500 SERVO3_MAX 1900 SERVO3_FUNCTION 74 FS_THR_VALUE 910 SCHED_LOOP_RATE 50""",
    mavlink.MAV_PARAM_TYPE_INT32: "RC_OPTIONS 32 ARMING_CHECK 1 ARMING_SKIPCHK 0",
    mavlink.MAV_PARAM_TYPE_REAL32: """RC_OVERRIDE_TIME 3 RC_FS_TIMEOUT 1 FS_TIMEOUT 1.5 FS_GCS_TIMEOUT 5 WP_SPEED 2
        CRUISE_SPEED 1.5 WP_RADIUS 2 LOIT_RADIUS 2 LOIT_SPEED_GAIN 0.5 ATC_ACCEL_MAX 0.8 ATC_SPEED_P 0.3 ATC_SPEED_I 0.2
        ATC_STR_ANG_P 1 ATC_STR_RAT_FF 1.8 ATC_STR_RAT_P 1.5 ATC_STR_RAT_I 0.5 ATC_STR_RAT_MAX 20 BATT_LOW_VOLT 14
        BATT_ARM_VOLT 14.2""",
}

# The state for the judgement of a test, SI units: heading not wrapped, u, v, r through the water, shafts [rad/s] and
# pulses [us] left and right, steering and throttle of the autopilot from -1 to 1.
FIELDS = "time north east heading u v r velocity_north velocity_east shafts pulses steering throttle mode armed"
Truth = collections.namedtuple("Truth", FIELDS)


def pulse_of(value, low, trim, high):
    """A value between -1 and 1 as a pulse [us]."""
    return int(trim + value * ((high - trim) if value > 0 else (trim - low)))


class Boat:
    """The boat with its autopilot, RC receiver and link.

    `start` runs it in a thread, `speed` times as fast as the clock of the computer; `run` advances it without waiting,
    for reproducible tests. May be set at any time: `faults`, `parameters`, `armed`, `receiver` (pulses of the RC
    receiver [us]), `mission` (points north and east of the start [m]), `clock` (s, added to that of the autopilot).
    Before the start: `drift` of the clock [ppm], `utc` (s since 1970 at time 0). `current` is (north, east) [m/s],
    `gusts` the standard deviation of the wind [m/s]. Release 4.6 of ArduPilot has SYSID_MYGCS, 4.7 MAV_GCS_SYSID.
    """

    def __init__(self, address, seed=0, speed=1.0, current=(0.0, 0.0), gusts=0.0, release="4.7"):
        self.faults, self.plant, self.sensors = Faults(), Plant(current), Sensors(seed)
        self.link = Link(address, self.faults, seed)
        self.receiver = [1500, 1500, 1500, 1500, 1500, 1500, 1900, 1165]
        self.mission, self.now, self.clock, self.drift, self.utc = [], 0.0, 100.0, 20.0, 1.8e9
        self._speed, self._gusts, self._is_new = speed, gusts, release >= "4.7"
        words = [(word, kind) for kind, text in PARAMETERS.items() for word in text.split()]
        other = ("SYSID_", "ARMING_C") if self._is_new else ("MAV_", "ARMING_S", "RC_FS_")  # names of the other release
        table = [(*pair, value) for pair, (value, _) in zip(words[::2], words[1::2]) if not pair[0].startswith(other)]
        self._types = {name: kind for name, kind, _ in table}
        self.parameters = {name: float(value) for name, _, value in table}
        self._mav = mavlink.MAVLink(self.link, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._thread, self._stopping, self._reboot_wanted, self._texts = None, threading.Event(), False, 0
        self.sensors.measure(0.0, self.plant, self.faults)
        self._boot(0.0)

    # Control from tests.

    def start(self):
        """Runs the boat in a thread until `stop`."""
        self._thread = threading.Thread(target=self._loop, daemon=True)
        self._thread.start()
        return self

    def stop(self):
        """Ends the thread and closes the link."""
        self._stopping.set()
        if self._thread:
            self._thread.join()
        self.link.socket.close()

    def run(self, seconds):
        """Advances the boat without waiting."""
        for _ in range(round(seconds / TICK)):
            self._tick()

    def sticks(self, steering, throttle):
        """Moves the sticks of the pilot, each from -1 to 1."""
        for name, value in (("ROLL", steering), ("THROTTLE", throttle)):
            channel, low, trim, high, _ = self._channel(name)
            self.receiver[channel] = pulse_of(value, low, trim, high)

    def mode_switch(self, mode):
        """Moves the mode switch of the pilot to the position of a mode."""
        position = next(n for n in range(6) if self.parameters[f"MODE{n + 1}"] == mode)
        self.receiver[int(self.parameters["MODE_CH"]) - 1] = 1165 + 130 * position

    def allow_overrides(self, allowed):
        """Moves the switch of the pilot that permits RC overrides (RC7_OPTION 46)."""
        self.receiver[6] = 1900 if allowed else 1100

    def reboot(self):
        """Restarts the autopilot; its clock begins again."""
        self._reboot_wanted = True

    @property
    def truth(self):
        """The state without errors."""
        plant, commands = self.plant, (self._pulses, self._steering, self._throttle, self.mode, self.armed)
        return Truth(self.now, *plant.state, *plant.rates(plant.state)[:2], plant.shafts, *commands)

    # Time.

    def _loop(self):
        base, start = self.now, time.monotonic()
        while not self._stopping.is_set():
            wanted = base + (time.monotonic() - start) * self._speed
            if wanted - self.now > 0.5 * self._speed:  # The computer is too slow: simulated time falls behind.
                base, start, wanted = self.now, time.monotonic(), self.now
            while self.now + TICK <= wanted and not self._stopping.is_set():
                self._tick()
            time.sleep(max(self.now + TICK - wanted, 0.0) / self._speed)

    def _tick(self):
        self.now = round(self.now + TICK, 6)
        wind = (self._gusts * self.sensors.errors["gust_n"], self._gusts * self.sensors.errors["gust_e"])
        self.plant.advance(self._pulses, self.faults.battery_volts / NOMINAL_VOLTS, wind)
        self.sensors.measure(self.now, self.plant, self.faults)
        is_up = self.now >= self._up_at
        for datagram in self.link.exchange(self.now):
            for message in self._parser.parse_buffer(datagram) or ():
                if is_up and message.get_type() != "BAD_DATA":
                    self._receive(message)
        if self._reboot_wanted:
            self._boot(self.now + BOOT_TIME)
        elif is_up:
            self._read_radio()
            self._check_failsafes()
            self._steer()
            for name, interval in self._intervals.items():
                due = self._sent[name] + interval
                if interval and self.now >= due:
                    self._sent[name] = due if self.now - due < interval else self.now
                    self._send(name)

    def _boot_us(self):
        """Clock of the autopilot [us]."""
        return int(1e6 * ((self.now - self._clock_start) * (1.0 + 1e-6 * self.drift) + self.clock))

    # Start and modes.

    def _boot(self, up_at):
        """State after a start of the autopilot, which is up at a time."""
        self._clock_start, self._up_at = self.now, up_at
        if self._reboot_wanted:
            self._reboot_wanted, self.clock = False, 0.0
        self.mode, self.armed = MANUAL, False
        self._steering, self._throttle, self._pulses = 0.0, 0.0, (0, 0)
        self._intervals, self._sent = dict(INTERVALS), dict.fromkeys(INTERVALS, -math.inf)
        self._sent_fix, self._told_prearm, self._told_battery = -1.0, up_at, False
        self._overrides, self._allows_overrides = {}, True
        self._radio, self._radio_time, self._gcs_time = [0] * 16, up_at, None
        self._failing, self._failing_since, self._triggered = set(), 0.0, set()
        self._switch, self._switch_since, self._switch_used = 0, 0.0, 0
        self._home = self._ekf_origin = (self.sensors.north, self.sensors.east)
        self._goal, self._goal_time, self._waypoint = ("loiter", *self._home), 0.0, 0
        self._speed_target = self._speed_sum = self._rate_sum = 0.0

    def _set_mode(self, mode):
        """Changes the mode; returns whether that was possible."""
        if mode == self.mode:
            return True
        has_place = mode in (MANUAL, HOLD) or not self.armed or self._has_position()
        if mode not in MODES or not has_place or (mode == AUTO and not self.mission):
            self._say(WARNING, "Flight mode change failed")
            return False
        self.mode, self._sent["HEARTBEAT"] = mode, -math.inf
        self._speed_target, self._speed_sum, self._rate_sum, self._waypoint = self.sensors.speed, 0.0, 0.0, 0
        self._loiter()
        if mode in (RTL, AUTO):
            self._goal = ("location", *(self._home if mode == RTL else self.mission[0]))
        return True

    def _has_position(self):
        return self.now - self.sensors.fix_time < 5.0

    def _refusal(self):
        """Why arming is refused; empty if it is not."""
        p, options = self.parameters, int(self.parameters["RC_OPTIONS"])
        checks = [
            (self.faults.prearm, self.faults.prearm),
            ("Radio" in self._failing, "Radio failsafe on"),
            (self.faults.battery_volts < p["BATT_ARM_VOLT"], "Battery 1 below minimum arming voltage"),
            (self.mode == RTL, "Mode not armable"),
            (self.mode not in (MANUAL, HOLD) and not self._has_position(), "Need Position Estimate"),
            (not options & 64 and self._stick("ROLL", 4500), f"Roll (RC{p['RCMAP_ROLL']:.0f}) is not neutral"),
            (options & 32 and self._stick("THROTTLE", 100), f"Throttle (RC{p['RCMAP_THROTTLE']:.0f}) is not neutral"),
        ]
        return next((text for failed, text in checks if failed), "")

    # Radio and failsafes.

    def _read_radio(self):
        """The pulses in force: overrides, else those of the receiver, else the last ones. Follows the mode switch."""
        timeout = self.parameters["RC_OVERRIDE_TIME"]
        if not self.faults.receiver_lost:
            self._radio[:8], self._radio_time = self.receiver, self.now
            if self.parameters["RC7_OPTION"] == 46 and not 1200 <= self.receiver[6] <= 1800:
                self._allows_overrides = self.receiver[6] > 1800
        if not self._allows_overrides:
            self._overrides.clear()
        for channel, (pulse, since) in self._overrides.items():
            if timeout < 0 or self.now - since < timeout:
                self._radio[channel], self._radio_time = pulse, max(self._radio_time, since)
        pulse = self._radio[int(self.parameters["MODE_CH"]) - 1]
        position = 1 + sum(pulse > limit for limit in (1230, 1360, 1490, 1620, 1749))
        if position != self._switch:
            self._switch, self._switch_since = position, self.now
        elif position != self._switch_used and self.now - self._switch_since >= 0.2 and 800 < pulse < 2200:
            self._switch_used = position
            self._set_mode(int(self.parameters[f"MODE{position}"]))

    def _channel(self, axis):
        """Index of the channel of an axis, its MIN, TRIM and MAX, and the sign of its direction."""
        n, p = int(self.parameters[f"RCMAP_{axis}"]), self.parameters
        return n - 1, p[f"RC{n}_MIN"], p[f"RC{n}_TRIM"], p[f"RC{n}_MAX"], -1 if p[f"RC{n}_REVERSED"] else 1

    def _stick(self, axis, high):
        """A stick as a whole number from -high to high, 0 in the dead zone; the division truncates as in C."""
        channel, low, trim, top, sign = self._channel(axis)
        dead, offset = self.parameters[f"RC{channel + 1}_DZ"], min(max(self._radio[channel], low), top) - trim
        span = (top - trim if offset > 0 else trim - low) - dead
        return sign * int(math.copysign(high * max(abs(offset) - dead, 0) / span, offset))

    def _pilot(self):
        """Steering and throttle of the pilot, -1 to 1; PILOT_STEER_TYPE 3 does not reverse the steering astern."""
        if "Radio" in self._failing:
            return 0.0, 0.0
        steering, throttle = self._stick("ROLL", 4500) / 4500.0, self._stick("THROTTLE", 100) / 100.0
        return -steering if throttle < 0 and self.parameters["PILOT_STEER_TYPE"] != 3 else steering, throttle

    def _check_failsafes(self):
        """Follows radio and ground station, which act once, FS_TIMEOUT after a failure, and the battery."""
        p, volts, now = self.parameters, self.faults.battery_volts, self.now
        is_low = self._radio[int(p["RCMAP_THROTTLE"]) - 1] < p["FS_THR_VALUE"]
        radio_failed = p["FS_THR_ENABLE"] and (is_low or now - self._radio_time > p.get("RC_FS_TIMEOUT", 0.5))
        gcs_failed = p["FS_GCS_ENABLE"] and self._gcs_time is not None and now - self._gcs_time > p["FS_GCS_TIMEOUT"]
        for name, failed in (("Radio", radio_failed), ("GCS", gcs_failed)):
            if failed and not self._failing:
                self._failing_since = now
            (self._failing.add if failed else self._failing.discard)(name)
            if self._triggered and not self._failing:
                self._say(INFO, f"{name} Failsafe Cleared")
            self._triggered &= self._failing
            is_due = failed and now - self._failing_since > p["FS_TIMEOUT"]
            if is_due and not self._triggered and self.mode not in (RTL, HOLD):
                self._triggered = set(self._failing)
                self._say(WARNING, f"{name} Failsafe")
                self._overrides.clear()
                self._act(p["FS_ACTION"])
        if volts < p["BATT_LOW_VOLT"] and not self._told_battery:
            self._told_battery = True
            self._say(WARNING, f"Battery 1 is low {volts:.2f}V used 0 mAh")
            self._act(p["BATT_FS_LOW_ACT"])
        if not self.armed and now - self._told_prearm > 30.0:
            self._tell_prearm()

    def _tell_prearm(self):
        self._told_prearm = self.now
        if reason := self._refusal():
            self._say(CRITICAL, f"PreArm: {reason}")

    def _act(self, action):
        """The action of a failsafe: 0 none, 1 RTL, 2 HOLD."""
        if action == 2 or (action == 1 and not self._set_mode(RTL)):
            self._set_mode(HOLD)

    # Steering.

    def _steer(self):
        """Steering, throttle and pulses of a tick, with MOT_SLEWRATE and the skid mixing; trim if disarmed."""
        p = self.parameters
        steering, throttle = 0.0, 0.0
        if self.armed and self.mode != HOLD:
            steering, throttle = self._pilot() if self.mode == MANUAL else self._follow_goal()
        scale = 1.0 / max(abs(steering) + abs(throttle), 1.0)
        change = max(p["MOT_SLEWRATE"] * TICK, 1.0) / 100.0 if p["MOT_SLEWRATE"] else 2.0
        slewed = self._throttle + clamp(scale * throttle - self._throttle, change)
        if self.mode == MANUAL and (throttle < 0) != (slewed < 0) and p["PILOT_STEER_TYPE"] != 3:
            steering = -steering
        self._steering, self._throttle = (scale * steering, slewed) if self.armed else (0.0, 0.0)
        scale = 1.0 / max(abs(self._steering) + abs(self._throttle), 1.0)
        sides = {73: scale * (self._throttle + self._steering), 74: scale * (self._throttle - self._steering)}
        self._pulses = (self._servo(1, sides), self._servo(3, sides))

    def _servo(self, n, sides):
        """Pulse [us] of a servo output; 0 if it has another function than a throttle."""
        p, function = self.parameters, self.parameters[f"SERVO{n}_FUNCTION"]
        value = -sides.get(function, 0.0) if p[f"SERVO{n}_REVERSED"] else sides.get(function, 0.0)
        pulse = pulse_of(value, p[f"SERVO{n}_MIN"], p[f"SERVO{n}_TRIM"], p[f"SERVO{n}_MAX"])
        return pulse if function in sides else 0

    def _loiter(self):
        """Holds the place where the boat can stop."""
        way = abs(self.sensors.speed) / (2.0 * self.parameters["ATC_ACCEL_MAX"])
        self._goal = ("loiter", self.sensors.north + way * self.sensors.vn, self.sensors.east + way * self.sensors.ve)

    def _follow_goal(self):
        """Steering and throttle to a location, in a place to hold, at heading and speed, or at turn rate and speed."""
        p, s = self.parameters, self.sensors
        if self._goal[0] in ("heading", "turn") and self.now - self._goal_time > GUIDED_TIMEOUT:
            self._say(WARNING, "target not received last 3secs, stopping")
            self._loiter()
        kind, a, b = self._goal
        if kind in ("heading", "turn"):
            pilot = self._pilot()[1] * p["CRUISE_SPEED"] / p["CRUISE_THROTTLE"] * 100.0  # raises the speed [m/s]
            speed = b if pilot * b <= 0 else math.copysign(max(abs(b), abs(pilot)), b)
            return self._drive(speed, a if kind == "turn" else p["ATC_STR_ANG_P"] * wrap(a - s.yaw))
        distance, error = math.hypot(a - s.north, b - s.east), wrap(math.atan2(b - s.east, a - s.north) - s.yaw)
        if kind == "location" and distance < p["WP_RADIUS"]:
            self._waypoint += 1
            is_last = self.mode != AUTO or self._waypoint >= len(self.mission)
            self._goal = ("loiter", a, b) if is_last else ("location", *self.mission[self._waypoint])
        if kind == "loiter" and distance < p["LOIT_RADIUS"]:
            return self._drive(0.0, 0.0)
        spare = distance - (p["LOIT_RADIUS"] if kind == "loiter" else 0.0)
        speed = min(spare * p["LOIT_SPEED_GAIN"], p["WP_SPEED"])
        if kind == "loiter" and abs(error) > math.pi / 2:
            speed, error = -speed, wrap(error + math.pi)
        return self._drive(speed * max(1.0 - abs(error) / (math.pi / 2), 0.0), p["ATC_STR_ANG_P"] * error)

    def _drive(self, speed, rate):
        """The controllers of speed over ground ahead [m/s] and yaw rate [rad/s]."""
        p, s = self.parameters, self.sensors
        rate = clamp(rate, math.radians(p["ATC_STR_RAT_MAX"]))
        self._speed_target += clamp(speed - self._speed_target, p["ATC_ACCEL_MAX"] * TICK)
        error = self._speed_target - s.speed
        self._speed_sum = clamp(self._speed_sum + p["ATC_SPEED_I"] * error * TICK, 0.5)
        self._rate_sum = clamp(self._rate_sum + p["ATC_STR_RAT_I"] * (rate - s.gyro) * TICK, 0.5)
        ahead = self._speed_target * 0.01 * p["CRUISE_THROTTLE"] / p["CRUISE_SPEED"]
        throttle = ahead + p["ATC_SPEED_P"] * error + self._speed_sum
        steering = p["ATC_STR_RAT_FF"] * rate + p["ATC_STR_RAT_P"] * (rate - s.gyro) + self._rate_sum
        return clamp(steering, 1.0), clamp(throttle, 1.0)

    # Messages to the boat.

    def _receive(self, m):
        system, component, kind, p = m.get_srcSystem(), m.get_srcComponent(), m.get_type(), self.parameters
        gcs = p["MAV_GCS_SYSID" if self._is_new else "SYSID_MYGCS"]
        is_gcs = gcs <= system <= max(p.get("MAV_GCS_SYSID_HI", 0), gcs)
        is_enforced = int(p["MAV_OPTIONS" if self._is_new else "SYSID_ENFORCE"]) & 1
        targets = (getattr(m, "target_system", 0), getattr(m, "target_component", 0))
        is_target = targets[0] in (0, SYSTEM) and targets[1] in (0, COMPONENT)
        is_loop = (system, component) == (SYSTEM, COMPONENT)
        if is_loop or not is_target or (is_enforced and not is_gcs and system != SYSTEM):
            return
        if is_gcs and kind in ("HEARTBEAT", "RC_CHANNELS_OVERRIDE", "MANUAL_CONTROL"):
            self._gcs_time = self.now
        match kind:
            case "RC_CHANNELS_OVERRIDE" if is_gcs:
                for channel in range(16):
                    self._override(channel, getattr(m, f"chan{channel + 1}_raw"))
            case "MANUAL_CONTROL" if is_gcs and m.target == SYSTEM:
                for axis, value in (("ROLL", m.y), ("THROTTLE", m.z)):
                    channel, low, _, high, _ = self._channel(axis)
                    self._override(channel, 0 if value == 32767 else int(low + (high - low) * (value + 1000) / 2000))
            case "TIMESYNC" if m.tc1 == 0:
                self._mav.timesync_send(1000 * self._boot_us(), m.ts1)
            case "SET_MODE" if m.base_mode & 1:
                self._set_mode(m.custom_mode)
            case "COMMAND_LONG" | "COMMAND_INT":
                result = self._command(m.command, *(x if math.isfinite(x) else 0.0 for x in (m.param1, m.param2)))
                self._mav.command_ack_send(m.command, result, 0, 0, system, component)
            case "REQUEST_DATA_STREAM":
                rate = m.req_message_rate if m.start_stop else 0
                for stream in STREAMS if m.req_stream_id == 0 else (m.req_stream_id,):
                    for name in STREAMS.get(stream, "").split():
                        self._intervals[name] = 1.0 / rate if rate else 0.0
            case "PARAM_REQUEST_LIST":
                for name in p:
                    self._send_parameter(name)
            case "PARAM_REQUEST_READ" | "PARAM_SET":
                index = getattr(m, "param_index", -1)
                name = [*p, ""][min(index, len(p))] if index >= 0 else m.param_id
                if name in p:
                    if kind == "PARAM_SET" and math.isfinite(m.param_value):
                        p[name] = m.param_value
                    self._send_parameter(name)
                elif self._is_new:
                    self._mav.param_error_send(system, component, m.param_id.encode(), index, 1)
            case "SET_POSITION_TARGET_LOCAL_NED" if m.coordinate_frame in (1, 7, 8, 9):
                turn = self.sensors.yaw if m.coordinate_frame in (8, 9) else 0.0
                base = self._ekf_origin if m.coordinate_frame == 1 else (self.sensors.north, self.sensors.east)
                x, y = m.x * math.cos(turn) - m.y * math.sin(turn), m.x * math.sin(turn) + m.y * math.cos(turn)
                self._guide(m, turn, (base[0] + x, base[1] + y))
            case "SET_POSITION_TARGET_GLOBAL_INT" if m.coordinate_frame in (0, 3, 5, 6, 10, 11):
                self._guide(m, 0.0, local(m.lat_int, m.lon_int))

    def _override(self, channel, pulse):
        """Takes the override of a channel (from 0): 0 releases the first eight, 65534 the others."""
        if pulse == (0 if channel < 8 else 65534):
            self._overrides.pop(channel, None)
        elif pulse not in (0, 65535) and self._allows_overrides and channel != 6:  # channel 7 has RC7_OPTION 46
            self._overrides[channel] = (pulse, self.now)

    def _guide(self, m, turn, location):
        """Takes a set-point in GUIDED; `turn` is the direction of its frame [rad]."""
        masks = (0x003, 0x018, 0x0C0, 0x400, 0x800)
        position, velocity, acceleration, yaw, rate = (not m.type_mask & mask for mask in masks)
        if self.mode != GUIDED or acceleration:
            if self.mode == GUIDED and self._is_new:
                self._say(INFO, f"Ignoring {m.get_type()}; set ACC_IGNORE in mask")
            return
        speed = min(math.hypot(m.vx, m.vy), self.parameters["WP_SPEED"]) if velocity else 0.0
        speed = -speed if (yaw or rate) and m.vx < 0 else speed
        if position:
            self._goal = ("location", *location)
        elif rate and not yaw:
            self._goal = ("turn", m.yaw_rate, speed)
        elif (yaw or velocity) and not rate:
            self._goal = ("heading", turn + (m.yaw if yaw else math.atan2(m.vy, m.vx)), speed)
        else:
            return
        self._goal_time = self.now

    def _command(self, command, first, second):
        """Carries out a command with its first two parameters; returns its MAV_RESULT."""
        name, reason = NAMES.get(int(first)), ""
        match command:
            case mavlink.MAV_CMD_DO_SET_MODE:
                return DENIED if not int(first) & 1 else ACCEPTED if self._set_mode(int(second)) else FAILED
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM if first in (0, 1):
                if first == 1 and not self.armed and second not in (2989, 21196):
                    reason = self._refusal()
                if reason or first != self.armed:
                    text = f"Arm: {reason}" if reason else "Throttle armed" if first else "Throttle disarmed"
                    self._say(CRITICAL if reason else INFO, text)
                self.armed = first == 1 and not reason
                return FAILED if reason else ACCEPTED
            case mavlink.MAV_CMD_RUN_PREARM_CHECKS:
                self._tell_prearm()
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                interval = int(second / 1000) / 1000.0
                is_fast = 0 < interval < 1.0 / (0.8 * self.parameters["SCHED_LOOP_RATE"])
                if is_fast:
                    self._say(INFO, f"Requested rate for message ID {first:.0f} too fast")
                if is_fast or name not in INTERVALS or second < -1:
                    return DENIED
                self._intervals[name] = INTERVALS[name] if second == 0 else max(interval, 0.0)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                return ACCEPTED if name and self._send(name) else FAILED
            case mavlink.MAV_CMD_DO_SET_HOME if first == 1:
                self._home = (self.sensors.north, self.sensors.east)
            case mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN if first == 1 and not self.armed:
                self._reboot_wanted = True
            case _:
                return UNSUPPORTED
        return ACCEPTED

    # Messages of the boat.

    def _say(self, severity, text):
        parts = [text[start : start + 50] for start in range(0, len(text), 50)]
        self._texts += 1
        for n, part in enumerate(parts):
            self._mav.statustext_send(severity, part.encode(), self._texts if len(parts) > 1 else 0, n)

    def _send_parameter(self, name):
        index, kind = list(self.parameters).index(name), self._types.get(name, mavlink.MAV_PARAM_TYPE_REAL32)
        self._mav.param_value_send(name.encode(), self.parameters[name], kind, len(self.parameters), index)

    def _send(self, name):
        """Sends a message; returns whether there was one to send."""
        content = self._content(name)
        if content:
            self._mav.send(getattr(self._mav, f"{name.lower()}_encode")(*content))
        return bool(content)

    def _content(self, name):
        """The fields of a message in the units of MAVLink, truncated as by ArduPilot; empty if there is none."""
        s, e, us, ms = self.sensors, self.sensors.errors, self._boot_us(), self._boot_us() // 1000
        is_lost, alt, course = self.faults.gnss_lost, int(1000 * e["alt"]), int(100 * math.degrees(s.yaw)) % 36000
        match name:
            case "HEARTBEAT":
                base = 1 + {MANUAL: 64, HOLD: 0}.get(self.mode, 8) + 128 * self.armed
                status = 5 if self._triggered else 3 if self.mode == HOLD else 4
                return mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, base, self.mode, status
            case "TIMESYNC":
                return 0, 1000 * us + SYSTEM
            case "RAW_IMU":
                gyro = (int(1000 * e["bias"]), int(-1000 * e["bias"]), int(1000 * s.gyro))
                field = (int(150 * math.cos(s.yaw)), int(-150 * math.sin(s.yaw)), 480)
                return us, *(int(1000 * a / GRAVITY) for a in s.force), *gyro, *field, 0, 2500
            case "SYS_STATUS":
                lost = RECEIVER_BIT * ("Radio" in self._failing) | PREARM_BIT * bool(not self.armed and self._refusal())
                lost |= BATTERY_BIT * self._told_battery | 32 * (not self._has_position())
                volts, amperes = self.faults.battery_volts, 0.5 + 0.15 * sum(map(abs, self.plant.shafts))
                charge = int(100 * max(0.0, min(1.0, (volts - 13.2) / 3.0)))
                power = (int(1000 * volts), int(100 * amperes), charge)
                return SENSOR_BITS, SENSOR_BITS, SENSOR_BITS & ~lost, 300, *power, 0, 0, 0, 0, 0, 0
            case "GPS_RAW_INT" if self._sent_fix != s.fix_time or is_lost:
                self._sent_fix = s.fix_time
                north, east, vn, ve = s.fix
                time_us, seen = 1000 * (ms - round(1000 * (self.now - s.fix_time))), 0 if is_lost else 14
                motion = (int(100 * math.hypot(vn, ve)), int(100 * math.degrees(math.atan2(ve, vn))) % 36000)
                rest = (alt + 40000, 700, 1200, 100, 0, 0)
                return time_us, 1 if is_lost else 3, *geographic(north, east), alt, 80, 120, *motion, seen, *rest
            case "SERVO_OUTPUT_RAW":
                return us & 0xFFFFFFFF, 0, self._pulses[0], 0, self._pulses[1], 0, 0, 0, 0, 0
            case "RC_CHANNELS":
                return ms, 8, *self._radio, 0, 0, 0 if self.faults.receiver_lost else 254
            case "GLOBAL_POSITION_INT":
                return ms, *geographic(s.north, s.east), alt, alt, int(100 * s.vn), int(100 * s.ve), 0, course
            case "LOCAL_POSITION_NED" if self._has_position():
                return ms, s.north - self._ekf_origin[0], s.east - self._ekf_origin[1], -e["alt"], s.vn, s.ve, 0.0
            case "ATTITUDE":
                return ms, e["roll"], e["pitch"], s.yaw, e["bias"], -e["bias"], s.gyro
            case "VFR_HUD":
                speed = math.hypot(s.vn, s.ve)
                return speed, speed, course // 100, int(abs(100 * self._throttle)), e["alt"], 0.0
            case "SYSTEM_TIME":
                return 0 if is_lost else int(1e6 * (self.utc + self.now)), ms
            case "EKF_STATUS_REPORT":
                is_far = s.rejected_since is not None
                flags = (831 if self._has_position() else 165) | 32768 * is_far
                return flags, 0.05, 1.5 if is_far else 0.04, 0.03, 0.8 if self.faults.compass_frozen else 0.03, 0.0
            case "HOME_POSITION":
                return *geographic(*self._home), 0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, us
        return ()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("address", nargs="?", default="127.0.0.1:14550", metavar="HOST:PORT", help="of hydroid")
    parser.add_argument("--speed", type=float, default=1.0, help="simulated seconds per second")
    parser.add_argument("--duration", type=float, default=math.inf, help="end after this simulated time [s]")
    parser.add_argument("--gusts", type=float, default=0.0, help="standard deviation of the wind [m/s]")
    parser.add_argument("--loss", type=float, default=0.0, help="share of the frames that are lost")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--current", type=float, nargs=2, default=(0.0, 0.0), metavar=("N", "E"), help="m/s")
    parser.add_argument("--release", choices=("4.6", "4.7"), default="4.7", help="release of ArduPilot")
    parser.add_argument("--armed", action="store_true", help="armed from the start, in MANUAL")
    parser.add_argument("--pilot", action="store_true", help="a pilot moves the sticks at random")
    args = parser.parse_args()
    host, port = args.address.rsplit(":", 1)
    boat = Boat((host, int(port)), args.seed, args.speed, tuple(args.current), args.gusts, args.release)
    boat.faults.loss, boat.armed, boat.utc = args.loss, args.armed, time.time()
    pilot, moved = random.Random(args.seed), -math.inf
    boat.start()
    try:
        while boat.now < args.duration:
            if args.pilot and boat.now - moved > 8.0:
                moved = boat.now
                boat.sticks(pilot.uniform(-0.6, 0.6), pilot.uniform(-0.4, 0.9))
            t = boat.truth
            print(
                f"{t.time:8.1f} s  {MODES[t.mode]:<12} {'armed' if t.armed else 'disarmed':<8}  N {t.north:7.1f}"
                f"  E {t.east:7.1f} m  {math.degrees(t.heading) % 360:5.1f} deg  u {t.u:5.2f}  v {t.v:5.2f} m/s"
                f"  r {math.degrees(t.r):5.1f} deg/s  servos {t.pulses[0]:4d} {t.pulses[1]:4d} us"
                f"  frames {boat.link.sent} out, {boat.link.received} in",
                flush=True,
            )
            time.sleep(1.0)
    except KeyboardInterrupt:
        pass
    boat.stop()


if __name__ == "__main__":
    main()
