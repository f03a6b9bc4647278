"""Remakes tests/golden/manoeuvres.json: turning circles and zigzags of two vessels, by Runge-Kutta steps of 1 ms for
pose and motion together, in plain Python. Equations and parameters: Fossen (2021), chapter 6, as in
crates/hydroid-core/src/vessel/plant.rs.

manoeuvres_golden.py [--write]: without --write it prints the largest difference from the file."""

import json
import math
import pathlib
import sys

FILE = pathlib.Path(__file__).resolve().parent.parent / "golden" / "manoeuvres.json"
DT, STEP = 0.01, 0.001
STEPS = round(DT / STEP)

M, X_G, I_Z = 80.0, 0.1375, 16.3025
ADDED = {"x": -5.5, "y": -82.5, "n": -25.143, "yr": 0.0}
ZERO = [[0.0] * 3] * 3
SIMPLE = dict(
    linear=[[77.55, 0.0, 0.0], [0.0, 162.5, -16.25], [0.0, -16.25, 82.88]],
    quadratic=ZERO, gain=1.0, sine=False, lag=1.0, flying=None,
)
HYDROFOIL = dict(
    linear=[[20.0, 0.0, 0.0], [0.0, 81.25, -8.125], [0.0, -8.125, 41.44]],
    quadratic=[[18.65, 0.0, 0.0], [0.0, 200.0, -20.0], [0.0, -20.0, 414.4]],
    gain=70.0, sine=True, lag=1.0, flying=dict(added=0.5, drag=0.5, speed=2.5, slope=12.0),
)


def mass(factor):
    return (
        M - factor * ADDED["x"],
        M - factor * ADDED["y"],
        M * X_G - factor * ADDED["yr"],
        I_Z - factor * ADDED["n"],
    )


def solve(m, f):
    m11, m22, m23, m33 = m
    det = m22 * m33 - m23 * m23
    return f[0] / m11, (m33 * f[1] - m23 * f[2]) / det, (m22 * f[2] - m23 * f[1]) / det


def rates(p, state, command):
    x, y, psi, u, v, r, force = state
    nu = (u, v, r)
    m11, m22, m23, m33 = mass(1.0)
    coriolis = (-(m22 * v + m23 * r) * r, m11 * u * r, m23 * u * r)
    drag = [sum((p["linear"][i][j] + p["quadratic"][i][j] * abs(nu[j])) * nu[j] for j in range(3)) for i in range(3)]
    rudder = math.sin(command[1]) if p["sine"] else command[1]
    tau = (force, 0.0, p["gain"] * u * rudder)
    acceleration = solve(mass(1.0), [tau[i] - coriolis[i] - drag[i] for i in range(3)])
    if p["flying"]:
        f = p["flying"]
        fly = solve(mass(f["added"]), [tau[i] - coriolis[i] - f["drag"] * drag[i] for i in range(3)])
        weight = 1.0 / (1.0 + math.exp(-f["slope"] * (u - f["speed"])))
        acceleration = [weight * a + (1.0 - weight) * b for a, b in zip(fly, acceleration)]
    c, s = math.cos(psi), math.sin(psi)
    return (u * c - v * s, u * s + v * c, r, *acceleration, (command[0] - force) / p["lag"])


def advance(p, state, command, steps=STEPS, step=STEP):
    for _ in range(steps):
        k1 = rates(p, state, command)
        k2 = rates(p, [a + 0.5 * step * b for a, b in zip(state, k1)], command)
        k3 = rates(p, [a + 0.5 * step * b for a, b in zip(state, k2)], command)
        k4 = rates(p, [a + step * b for a, b in zip(state, k3)], command)
        state = [a + step / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(state, k1, k2, k3, k4)]
    return state


def approach(p, force):
    state = [0.0] * 7
    state[3], state[6] = 1.0, force
    for _ in range(6000):
        state = advance(p, state, (force, 0.0))
    return [0.0, 0.0, 0.0, *state[3:]]


def crossing(before, after, level):
    """Share of a sample at which the heading passes a level."""
    return (level - before[2]) / (after[2] - before[2])


def circle(p, force, rudder):
    state = start = approach(p, force)
    result, turned = {}, []
    while state[2] < 3 * math.pi:
        next_state = advance(p, state, (force, rudder))
        for level, names in ((math.pi / 2, ("advance_m", "transfer_m", "time_to_90_degrees_s")),
                             (math.pi, (None, "tactical_diameter_m", "time_to_180_degrees_s"))):
            if state[2] < level <= next_state[2]:
                share = crossing(state, next_state, level)
                x, y = (a + share * (b - a) for a, b in zip(state[:2], next_state[:2]))
                for name, value in zip(names, (x, y, (len(turned) + share) * DT)):
                    if name:
                        result[name] = value
        state = next_state
        turned.append(state)
    u, v, r = turned[-1][3:6]
    result["steady_radius_m"] = math.hypot(u, v) / r
    result["drift_angle_deg"] = -math.degrees(math.atan2(v, u))
    result["speed_loss_percent"] = 100 * (1 - math.hypot(u, v) / start[3])
    return result


def zigzag(p, force, rudder, heading):
    state, side, k = approach(p, force), 1, 0
    executes, overshoots = [0], []
    while len(overshoots) < 3:
        before = state[2]
        state = advance(p, state, (force, side * rudder))
        k += 1
        if side * state[2] >= heading:
            if len(executes) == 1:
                initial_turning = (k - 1 + (heading - before) / (state[2] - before)) * DT
            executes.append(k)
            side = -side
            probe, peak = state, 0.0
            while -side * probe[5] > 0:
                probe = advance(p, probe, (force, side * rudder), 1)
                peak = max(peak, -side * (probe[2] - state[2]))
            overshoots.append(math.degrees(peak))
    names = ("first_overshoot_deg", "second_overshoot_deg", "third_overshoot_deg")
    return {**dict(zip(names, overshoots)), "initial_turning_time_s": initial_turning}


def main():
    golden = {
        "simple": {
            "circle": circle(SIMPLE, 204.0, 25.0),
            "zigzag": zigzag(SIMPLE, 204.0, 5.0, math.radians(20)),
        },
        "hydrofoil": {
            "circle": circle(HYDROFOIL, 297.5, math.radians(30)),
            "zigzag": zigzag(HYDROFOIL, 297.5, math.radians(10), math.radians(10)),
        },
    }
    if "--write" in sys.argv:
        FILE.write_text(json.dumps(golden, indent=1) + "\n")
    else:
        kept = json.loads(FILE.read_text())
        differences = [
            abs(value / kept[vessel][trial][name] - 1)
            for vessel, trials in golden.items()
            for trial, figures in trials.items()
            for name, value in figures.items()
        ]
        print(f"largest relative difference: {max(differences):.1e}")


if __name__ == "__main__":
    main()
