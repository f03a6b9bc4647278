"""What surrounds the autopilot of the simulated boat: the boat in the water, its sensors, and the link, with faults.

Positions are north and east [m] of the start, headings clockwise from north [rad], body axes forward and starboard;
positive yaw rates and moments turn to starboard. The boat is a catamaran of 2 m with two fixed thrusters in three
degrees of freedom (Fossen 2021, chapters 6 and 9),

    M nu' + C(nu) nu + D(nu) nu = tau,    (north', east') = R(heading) (u, v) + current,    heading' = r,

with nu = (u, v, r) relative to the water, M = [[m11, 0, 0], [0, m22, m23], [0, m23, m33]] of rigid body and added mass,
C(nu) nu = (-(m22 v + m23 r) r, m11 u r, (m22 v + m23 r) u - m11 u v), and D(nu) nu of linear and quadratic terms and
the cross-flow drag, 1/2 rho T Cd times the integral of |v + x r| (v + x r) (1, x) over the length. Coefficients are
those of hydroid's vessels/otter.toml, except for lag, dead band, and the damping of surge, which is mostly quadratic. A
shaft follows 0.25 rad/s per us of the pulse with a first-order lag. The thrust is k s |s|, with s the speed of the
shaft less the dead band, and a smaller k astern. The current is constant. Gusts of wind push the hull.

The estimates of the EKF are the truth with slowly varying errors; roll and pitch are noise.
"""

import collections
import heapq
import math
import random
import socket
from dataclasses import dataclass

import numpy as np

TICK, STEP = 0.02, 0.005  # s, loop of the autopilot and integration step of the plant
GRAVITY, NOMINAL_VOLTS = 9.80665, 16.0  # m/s^2, V
ORIGIN = (63.44, 10.36)  # latitude and longitude of the start [deg]
NORTH_UNIT = 0.011131884502145034  # m for 1e-7 degrees of latitude, as in ArduPilot
EAST_UNIT = NORTH_UNIT * math.cos(math.radians(ORIGIN[0]))


@dataclass
class Faults:
    """Faults of the link in both directions (probabilities for a frame), of sensors and radio."""

    loss: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0  # one byte of the frame is flipped
    reordering: float = 0.0  # the frame is delayed by up to 0.3 s
    delay: float = 0.0  # s, of every frame
    silent_until: float = 0.0  # s, nothing passes before this time
    gnss_lost: bool = False
    gnss_jump: tuple[float, float] = (0.0, 0.0)  # m north and east, added to fixes
    compass_frozen: bool = False
    receiver_lost: bool = False  # the RC receiver gives no pulses
    prearm: str = ""  # a reason to refuse arming
    battery_volts: float = NOMINAL_VOLTS


def wrap(angle):
    """The angle between -pi and pi."""
    return math.remainder(angle, math.tau)


def clamp(value, limit):
    """The value between -limit and limit."""
    return max(-limit, min(limit, value))


def geographic(north, east):
    """Latitude and longitude in 1e-7 degrees."""
    return round(1e7 * ORIGIN[0] + north / NORTH_UNIT), round(1e7 * ORIGIN[1] + east / EAST_UNIT)


def local(latitude, longitude):
    """North and east [m] of a latitude and longitude in 1e-7 degrees."""
    return (latitude - 1e7 * ORIGIN[0]) * NORTH_UNIT, (longitude - 1e7 * ORIGIN[1]) * EAST_UNIT


class Plant:
    """The boat in the water: state (north, east, heading, u, v, r) and speeds of the shafts [rad/s]."""

    M11, M22, M23, M33 = 85.5, 162.5, 11.0, 41.4455  # kg, kg, kg m, kg m^2
    SURGE, SURGE_2, SWAY, YAW, YAW_2 = 20.0, 20.2, 162.5, 41.44, 414.4  # damping, SI units
    AHEAD, ASTERN, DEAD_BAND, LAG, ARM = 0.01108, 0.006445, 5.0, 0.2, 0.395  # N s^2, N s^2, rad/s, s, m
    WIND = 0.36  # 1/2 rho A C of the hull in air [N s^2/m^2]
    # Points of the Gauss-Legendre quadrature over the length of 2 m [m], with 1/2 rho T Cd times their weights [kg/m].
    STRIPS = tuple(zip(*map(np.ndarray.tolist, np.polynomial.legendre.leggauss(4) * np.array([[1.0], [71.75]]))))

    def __init__(self, current):
        self.state, self.shafts = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0)
        self.current, self._forces = current, (0.0, 0.0, 0.0)

    def rates(self, state):
        """Derivatives of a state."""
        _, _, heading, u, v, r = state
        surge, sway, moment = self._forces
        for x, factor in self.STRIPS:
            drag = factor * abs(v + x * r) * (v + x * r)
            sway -= drag
            moment -= drag * x
        lateral = self.M22 * v + self.M23 * r
        surge += lateral * r - (self.SURGE + self.SURGE_2 * abs(u)) * u
        sway -= self.M11 * u * r + self.SWAY * v
        moment -= (lateral - self.M11 * v) * u + (self.YAW + self.YAW_2 * abs(r)) * r
        det = self.M22 * self.M33 - self.M23 * self.M23
        cos, sin = math.cos(heading), math.sin(heading)
        north, east = cos * u - sin * v + self.current[0], sin * u + cos * v + self.current[1]
        v_rate = (self.M33 * sway - self.M23 * moment) / det
        return north, east, r, surge / self.M11, v_rate, (self.M22 * moment - self.M23 * sway) / det

    def _thrust(self, shaft):
        excess = max(abs(shaft) - self.DEAD_BAND, 0.0)
        return self.AHEAD * excess * excess if shaft > 0 else -self.ASTERN * excess * excess

    def advance(self, pulses, supply, wind):
        """One tick (Runge-Kutta); `supply` is the voltage over the nominal one, `wind` the velocity of the air (NE)."""
        cos, sin, drag = math.cos(self.state[2]), math.sin(self.state[2]), self.WIND * math.hypot(*wind)
        ahead, abeam = drag * (wind[0] * cos + wind[1] * sin), drag * (wind[1] * cos - wind[0] * sin)
        orders = [0.25 * clamp(pulse - 1500, 400) * supply if pulse else 0.0 for pulse in pulses]
        keep = math.exp(-STEP / self.LAG)
        for _ in range(round(TICK / STEP)):
            self.shafts = tuple(order + keep * (shaft - order) for order, shaft in zip(orders, self.shafts))
            left, right = map(self._thrust, self.shafts)
            self._forces = (left + right + ahead, abeam, self.ARM * (left - right) + 0.1 * abeam)
            k1 = self.rates(self.state)
            k2 = self.rates([s + 0.5 * STEP * k for s, k in zip(self.state, k1)])
            k3 = self.rates([s + 0.5 * STEP * k for s, k in zip(self.state, k2)])
            k4 = self.rates([s + STEP * k for s, k in zip(self.state, k3)])
            rows = zip(self.state, k1, k2, k3, k4)
            self.state = tuple(s + STEP / 6.0 * (a + 2.0 * (b + c) + d) for s, a, b, c, d in rows)


# Errors of the sensors: standard deviation and time constant [s] in SI units; white noise has the time constant 0.
ERRORS = {
    "north": (0.6, 120), "east": (0.6, 120), "alt": (0.8, 120), "fix_north": (0.1, 0), "fix_east": (0.1, 0),
    "fix_vn": (0.05, 0), "fix_ve": (0.05, 0), "vn": (0.03, 2), "ve": (0.03, 2), "yaw": (0.02, 100),
    "yaw_white": (0.001, 0), "roll": (0.02, 0.5), "pitch": (0.01, 0.5), "gyro": (0.003, 0), "bias": (0.0005, 300),
    "ax": (0.05, 0), "ay": (0.05, 0), "az": (0.05, 0), "gust_n": (1, 4), "gust_e": (1, 4),
}  # fmt: skip


class Sensors:
    """Measurements with their errors: inertial sensors, GNSS fixes, and the estimates of the EKF."""

    GATE, RESET_TIME = 5.0, 10.0  # m and s: the EKF rejects fixes that are farther off, for this time

    def __init__(self, seed):
        self._rng = np.random.default_rng(seed)
        deviation, time_constant = np.array(list(ERRORS.values())).T
        self._keep = np.where(time_constant > 0, np.exp(-TICK / np.maximum(time_constant, 1e-9)), 0.0)
        self._drive = deviation * np.sqrt(1.0 - self._keep**2)
        self._values = deviation * self._rng.standard_normal(deviation.size)
        self._history = collections.deque(maxlen=11)  # the delay of GNSS is 10 ticks
        self._jump, self.rejected_since = (0.0, 0.0), None

    def measure(self, now, plant, faults):
        """The measurements of a tick."""
        self._values = self._keep * self._values + self._drive * self._rng.standard_normal(self._values.size)
        e = self.errors = dict(zip(ERRORS, self._values.tolist()))
        north, east, heading, u, v, r = plant.state
        vn, ve, _, u_rate, v_rate, _ = plant.rates(plant.state)
        self._history.append((north, east, vn, ve))
        if round(now / TICK) % 10 == 0 and not faults.gnss_lost:
            errors = (e["north"] + e["fix_north"], e["east"] + e["fix_east"], e["fix_vn"], e["fix_ve"])
            # North, east [m] and their velocities [m/s].
            self.fix = [sum(terms) for terms in zip(self._history[0], errors, (*faults.gnss_jump, 0.0, 0.0))]
            self.fix_time = now
            # The estimate follows a jump of the fixes at once if it is small, else by a reset after a time.
            is_far = math.dist(faults.gnss_jump, self._jump) > self.GATE
            since = (self.rejected_since or now) if is_far else None
            is_accepted = since is None or now - since > self.RESET_TIME
            self._jump, self.rejected_since = (faults.gnss_jump, None) if is_accepted else (self._jump, since)
        self.north, self.east = north + e["north"] + self._jump[0], east + e["east"] + self._jump[1]
        self.vn, self.ve, self.gyro = vn + e["vn"], ve + e["ve"], r + e["gyro"] + e["bias"]
        self.force = (u_rate - v * r + e["ax"], v_rate + u * r + e["ay"], e["az"] - GRAVITY)
        if not faults.compass_frozen:
            self.yaw = wrap(heading + e["yaw"] + e["yaw_white"])
        self.speed = self.vn * math.cos(self.yaw) + self.ve * math.sin(self.yaw)


class Link:
    """UDP datagrams to an address and back, with faults in both directions."""

    def __init__(self, address, faults, seed):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self._address, self._faults, self._random = address, faults, random.Random(seed)
        self._waiting, self._count, self._now = [], 0, 0.0
        self.sent = self.received = 0

    def write(self, frame, is_out=True):
        """Sends a frame (pymavlink calls it), or takes one that has arrived."""
        faults, chance = self._faults, self._random.random
        if self._now < faults.silent_until or chance() < faults.loss:
            return
        for _ in range(2 if chance() < faults.duplication else 1):
            copy = bytearray(frame)
            if chance() < faults.corruption:
                copy[self._random.randrange(len(copy))] ^= self._random.randrange(1, 256)
            due = self._now + faults.delay + (0.3 * chance() if chance() < faults.reordering else 0.0)
            if is_out and due <= self._now:
                self._send(copy)
            else:
                self._count += 1
                heapq.heappush(self._waiting, (due, self._count, is_out, copy))

    def _send(self, frame):
        self.socket.sendto(frame, self._address)
        self.sent += 1

    def exchange(self, now):
        """Sends what is due and returns the datagrams that have arrived."""
        self._now, arrived = now, []
        try:
            while True:
                self.write(self.socket.recv(2048), is_out=False)
        except (BlockingIOError, ConnectionError):
            pass
        while self._waiting and self._waiting[0][0] <= now:
            _, _, is_out, frame = heapq.heappop(self._waiting)
            if is_out:
                self._send(frame)
            else:
                arrived.append(frame)
                self.received += 1
        return arrived
