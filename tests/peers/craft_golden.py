"""Remakes tests/golden/craft.json: open-loop runs, a turning circle and a zigzag of vessels with any set of actuators
(vessels/*.toml), by Runge-Kutta steps of 2 to 20 ms for pose, motion and positions of actuators together, in plain
Python. Equations: Fossen (2021), chapter 6 and section 9.1, and for rudders Yasukawa and Yoshimura (2015), as in the
documentation of crates/hydroid-core/src/craft/mod.rs, and from it alone.

craft_golden.py [--write] [--halve]: without --write it prints the largest difference from the file; --halve halves the
steps, and the difference is then the error of the steps."""

import json
import math
import pathlib
import re
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
VESSELS = HERE.parent.parent / "vessels"
FILE = HERE.parent / "golden" / "craft.json"
ROWS = 20
SHARE = 0.5 if "--halve" in sys.argv else 1.0

# A case: name, duration [s], and commands from a time on, in the units of the vessel file.
# A circle: approach, then hard over to starboard. A zigzag: approach, to starboard, to port, heading [deg].
PLAN = {
    "otter": dict(step=0.002, cases=[
        ("ahead", 60, [(0, 1900, 1900), (40, 1600, 1600)]),
        ("one propeller", 60, [(0, 1800, 1500), (30, 1500, 1700)]),
        ("hard over", 60, [(0, 1800, 1800), (15, 1900, 1100), (35, 1100, 1900)]),
        ("astern", 60, [(0, 1100, 1100), (30, 1150, 1400)]),
        ("crash stop", 60, [(0, 1900, 1880), (30, 1100, 1110)]),
    ], circle=[(1840, 1840), (1900, 1440)], zigzag=[(1840, 1840), (1900, 1760), (1760, 1900), 20]),
    "mariner": dict(step=0.02, cases=[
        ("ahead", 600, [(0, 90, 0)]),
        ("hard over", 600, [(0, 80, 0), (150, 80, 35), (390, 80, -35)]),
        ("astern", 600, [(0, -60, 5), (300, -40, -20)]),
        ("crash stop", 600, [(0, 90, 0), (210, -60, 35), (480, 60, -20)]),
        ("no thrust", 600, [(0, 70, -35), (240, 0, 35)]),
    ], circle=[(76.5, 0), (76.5, 35)], zigzag=[(76.5, 0), (76.5, 10), (76.5, -10), 10]),
    "tug": dict(step=0.005, cases=[
        ("ahead", 200, [(0, 100, 0, 100, 0)]),
        ("turns", 200, [(0, 80, 0, 80, 0), (60, 80, -35, 80, -35), (120, 80, 60, 80, 60)]),
        ("astern", 200, [(0, 70, 175, 80, -170), (100, 100, 135, 60, -120)]),
        ("asymmetric", 200, [(0, 100, 60, 40, -60), (80, 0, 60, 100, 0), (140, 50, -90, 20, 90)]),
        ("crash stop", 200, [(0, 100, 0, 100, 0), (100, 100, 180, 95, -180)]),
    ], circle=[(85, 0, 85, 0), (85, -35, 85, -35)], zigzag=[(85, 0, 85, 0), (85, -10, 85, -10), (85, 10, 85, 10), 10]),
    "workboat": dict(step=0.002, folder=HERE.parent / "golden", cases=[
        ("ahead and astern", 60, [(0, 0.8, 0.2, 2, 0), (20, 0.9, -0.5, 20, 60), (40, -0.7, 0.4, -30, -80)]),
        ("dead bands", 60, [(0, -0.8, 0.2, 12, 30), (20, 0.02, 0.1, -20, -100), (40, 0.5, -1, 37, 4)]),
        ("crash stop", 60, [(0, 1, 0, -36, 0), (30, -1, 0, 40, 100)]),
    ]),
}


def matrix(rows):
    return rows if isinstance(rows[0], list) else [[rows[i] if i == j else 0.0 for j in range(3)] for i in range(3)]


class Vessel:
    """State: x, y, psi, u, v, r, then the positions of the servos."""

    def __init__(self, path, step):
        f = tomllib.loads(path.read_text())
        self.step, self.rho, hull = step, f["water_density"], f["hull"]
        self.length, self.draught = hull["length"], hull["draught"]
        body, added, drag = f["rigid_body"], f["added_mass"], f["drag"]
        self.m11, self.m22 = body["mass"] - added["x_udot"], body["mass"] - added["y_vdot"]
        self.m23, self.m33 = body["mass"] * body["x_g"] - added.get("y_rdot", 0.0), body["i_z"] - added["n_rdot"]
        self.linear, self.quadratic = (matrix(drag.get(k, [0.0] * 3)) for k in ("linear", "quadratic"))
        self.lift, self.cross_flow = drag.get("lift", [[0.0, 0.0], [0.0, 0.0]]), drag.get("cross_flow", 0.0)
        self.commands = f["command"]
        named = {t["name"]: t for t in f["thruster"]}
        self.thrusters = [{**named[t["like"]], **t} if "like" in t else t for t in f["thruster"]]
        self.rudders = f.get("rudder", [])
        self.servos = []
        for actuator in self.thrusters + self.rudders:
            for part in [actuator] + ([actuator["steering"]] if "steering" in actuator else []):
                self.servos.append((part["order"], part.get("lag", 0.0), part.get("rate")))

    def orders(self, values):
        """Orders of the servos; a command counts in the unit of the file, but an angle in radians."""
        amounts = {c["name"]: (value - c.get("neutral", 0.0)) * (math.pi / 180 if c["unit"] == "deg" else 1.0)
                   for c, value in zip(self.commands, values)}
        return [sum(gain * amounts[name] for name, gain in order.items()) for order, _, _ in self.servos]

    def rest(self, values):
        return [0.0] * 6 + self.orders(values)

    def forces(self, u, v, r, positions):
        positions = iter(positions)
        total, wakes = [0.0, 0.0, 0.0], {}
        for t in self.thrusters:
            (x, y), a = t["position"], next(positions)
            n = math.copysign(max(abs(a) - t.get("dead_band", 0.0), 0.0), a)
            alpha = t.get("angle", 0.0) + (next(positions) if "steering" in t else 0.0)
            c, s = math.cos(alpha), math.sin(alpha)
            ua = (u - y * r) * c + (v + x * r) * s
            k = t["forward"] if n > 0 else t.get("reverse", t["forward"])
            static = k * n if t.get("law") == "linear" else k * n * abs(n)
            thrust = static - t.get("speed_loss", 0.0) * abs(n) * ua  # the loss holds for both laws
            wakes[t["name"]] = (thrust, ua, t.get("diameter"))
            total = [total[0] + thrust * c, total[1] + thrust * s, total[2] + thrust * (x * s - y * c)]
        for d in self.rudders:
            (x, y), delta = d["position"], next(positions)
            ur = (1.0 - d.get("wake", 0.0)) * (u - y * r)
            if "thruster" in d:
                thrust, ua, diameter = wakes[d["thruster"]]
                if thrust > 0:
                    jet = math.sqrt(ua * ua + 2 * thrust / (self.rho * math.pi * diameter**2 / 4))
                    ur += d["race"] * (jet - abs(ua))
            vr = d.get("straightening", 1.0) * (v + x * r)
            s, c = math.sin(delta), math.cos(delta)
            fn = self.rho / 2 * d["area"] * d["lift_slope"] * math.hypot(ur, vr) * (ur * s + vr * c)
            drag, ah, xh = (d.get(k, 0.0) for k in ("drag_deduction", "hull_force", "hull_position"))
            total[0] -= fn * (1 - drag) * s
            total[1] -= fn * (1 + ah) * c
            total[2] -= fn * ((x + ah * xh) * c - y * (1 - drag) * s)
        return total

    def cross(self, v, r):
        """Integrals of |w| w and x |w| w, w = v + x r, by 3 Gauss points on each side of the zero of w: exact."""
        half = self.length / 2
        zero = max(-half, min(half, -v / r)) if r else half
        force = moment = 0.0
        for a, b in ((-half, zero), (zero, half)):
            for node, weight in ((-math.sqrt(0.6), 5 / 18), (0.0, 8 / 18), (math.sqrt(0.6), 5 / 18)):
                x = (a + b) / 2 + (b - a) / 2 * node
                part = weight * (b - a) * abs(v + x * r) * (v + x * r)
                force, moment = force + part, moment + x * part
        return force, moment

    def rates(self, state, orders, ramps):
        _, _, psi, u, v, r, *positions = state
        nu, m11, m22, m23, m33 = (u, v, r), self.m11, self.m22, self.m23, self.m33
        coriolis = (-(m22 * v + m23 * r) * r, m11 * u * r, (m22 - m11) * u * v + m23 * u * r)
        drag = [sum((a + b * abs(w)) * w for a, b, w in zip(*rows, nu)) for rows in zip(self.linear, self.quadratic)]
        k = self.rho / 2 * self.draught * self.cross_flow
        for i, (lift, integral) in enumerate(zip(self.lift, self.cross(v, r)), 1):
            drag[i] += abs(u) * (lift[0] * v + lift[1] * r) + k * integral
        f = [t - c - d for t, c, d in zip(self.forces(u, v, r, positions), coriolis, drag)]
        det = m22 * m33 - m23 * m23
        moved = []
        for (_, lag, rate), order, a, ramp in zip(self.servos, orders, positions, ramps):
            most = math.inf if rate is None else rate
            moved.append(max(-most, min(most, (order - a) / lag)) if lag else ramp)
        c, s = math.cos(psi), math.sin(psi)
        return (u * c - v * s, u * s + v * c, r, f[0] / m11, (m33 * f[1] - m23 * f[2]) / det,
                (m22 * f[2] - m23 * f[1]) / det, *moved)

    def advance(self, state, orders, h):
        """A step; it is divided where a servo without lag arrives at its order."""
        while h > 0:
            part, ramps, state = h, [0.0] * len(orders), list(state)
            for i, (_, lag, rate) in enumerate(self.servos):
                gap = orders[i] - state[6 + i]
                if not lag and (rate is None or abs(gap) < 1e-13):
                    state[6 + i] = orders[i]
                elif not lag:
                    ramps[i] = math.copysign(rate, gap)
                    part = min(part, abs(gap) / rate)
            k1 = self.rates(state, orders, ramps)
            k2 = self.rates([a + 0.5 * part * b for a, b in zip(state, k1)], orders, ramps)
            k3 = self.rates([a + 0.5 * part * b for a, b in zip(state, k2)], orders, ramps)
            k4 = self.rates([a + part * b for a, b in zip(state, k3)], orders, ramps)
            state = [a + part / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(state, k1, k2, k3, k4)]
            h -= part
        return state

    def steady(self, state, values):
        """The steady motion; a longer step does not change it."""
        orders, h, calm = self.orders(values), 10 * self.step, 0
        while calm < 100:
            after = self.advance(state, orders, h)
            change = max(abs(a - b) for a, b in zip(after[3:], state[3:]))
            calm, state = (calm + 1 if change < 1e-13 else 0), after
        return state

    def case(self, name, duration, plan):
        state, k, rows, h = self.rest(plan[0][1:]), 0, [], self.step
        per = round(duration / ROWS / h)
        for (_, *values), end in zip(plan, [p[0] for p in plan[1:]] + [duration]):
            orders = self.orders(values)
            while k < round(end / h):
                state, k = self.advance(state, orders, h), k + 1
                if k % per == 0:
                    rows.append([k * h, *state[3:6]])
        return {"name": name, "commands": [{"t": t, "values": values} for t, *values in plan],
                "dt": duration / ROWS, "rows": rows}

    def circle(self, approach, over):
        state = self.steady(self.rest(approach), approach)
        result = {"approach": approach, "commands": over, "approach_speed_m_s": state[3]}
        state[:3], orders, t, h = [0.0] * 3, self.orders(over), 0.0, self.step
        while state[2] < math.pi:
            after = self.advance(state, orders, h)
            for level, x, y, time in ((math.pi / 2, "advance_m", "transfer_m", "time_to_90_degrees_s"),
                                      (math.pi, None, "tactical_diameter_m", "time_to_180_degrees_s")):
                if state[2] < level <= after[2]:
                    share = (level - state[2]) / (after[2] - state[2])
                    place = [a + share * (b - a) for a, b in zip(state[:2], after[:2])]
                    result |= {name: value for name, value in zip((x, y, time), (*place, t + share * h)) if name}
            state, t = after, t + h
        u, v, r = self.steady(state, over)[3:6]
        return result | {"steady_radius_m": math.hypot(u, v) / r, "drift_angle_deg": -math.degrees(math.atan2(v, u)),
                         "steady_yaw_rate_deg_s": math.degrees(r)}

    def zigzag(self, approach, starboard, port, heading):
        state = self.steady(self.rest(approach), approach)
        state[:3], level, side, t, h = [0.0] * 3, math.radians(heading), 1, 0.0, self.step
        times, peaks, peak = [], [], 0.0
        while len(times) < 3:
            orders = self.orders(starboard if side > 0 else port)
            after = self.advance(state, orders, h)
            peak = max(peak, -side * after[2])
            if side * state[5] < 0 <= side * after[5]:  # the heading turns between: the vertex of a parabola
                peak = max(peak, -side * (state[2] + h / 2 * state[5] * state[5] / (state[5] - after[5])))
            if side * after[2] >= level:
                # The order is reversed where the heading passes the level, not at the end of the step.
                share = (level - side * state[2]) / (side * (after[2] - state[2])) * h
                after = self.advance(state, orders, share)
                times, peaks = times + [t + share], peaks + [peak]
                t, side, peak = t + share - h, -side, 0.0
            state, t = after, t + h
        return {"approach": approach, "starboard": starboard, "port": port, "heading_deg": heading,
                "first_overshoot_deg": math.degrees(peaks[1]) - heading,
                "second_overshoot_deg": math.degrees(peaks[2]) - heading, "initial_turning_time_s": times[0]}


def rounded(value):
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v) for v in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def differences(vessel, kept):
    """Of rows: relative to the largest value of the run; of figures: relative."""
    for a, b in zip(vessel["cases"], kept["cases"], strict=True):
        for p, q in zip(zip(*a["rows"]), zip(*b["rows"])):
            yield max(abs(x - y) for x, y in zip(p, q)) / max(1e-300, *map(abs, q)), f"case {a['name']}"
    for trial in vessel.keys() - {"cases"}:
        for name, value in vessel[trial].items():
            if isinstance(value, float):
                yield abs(value / kept[trial][name] - 1), f"{trial} {name}"


golden = {}
for name, plan in PLAN.items():
    vessel = Vessel(plan.get("folder", VESSELS) / f"{name}.toml", plan["step"] * SHARE)
    figures = {"cases": [vessel.case(*case) for case in plan["cases"]]}
    for trial in [trial for trial in ("circle", "zigzag") if trial in plan]:
        figures[trial] = getattr(vessel, trial)(*plan[trial])
    golden[name] = rounded(figures)
if "--write" in sys.argv:
    text = json.dumps(golden, indent=1)
    FILE.write_text(re.sub(r"\[[^\[\]{}]*\]", lambda row: " ".join(row[0].split()), text) + "\n")
else:
    kept = json.loads(FILE.read_text())
    for name, vessel in golden.items():
        difference, where = max(differences(vessel, kept[name]))
        print(f"{name}: largest relative difference: {difference:.1e} ({where})")
