"""Makes tests/golden/tanker.csv and tanker.json: a model of the tanker KVLCC2 (7 m) at a constant shaft speed, simulated by
the package shipmmg 0.0.11 (MIT) with the MMG standard method. The CSV is a log of rudder steps with measurement noise; the
JSON has turning circles with 35 degrees of rudder to both sides, from a step at the steady speed. Numbers of the ship: H. Yasukawa and
Y. Yoshimura, Introduction of MMG standard method for ship maneuvering predictions, J. Mar. Sci. Technol. 20 (2015) 37,
but for the flow straightening coefficient, which is the mean of both sides: the ship turns alike to port and starboard.

pip install shipmmg; shipmmg_tanker.py [--write]: without --write it prints the figures of the circles."""

import json
import math
import pathlib
import random
import sys

from shipmmg.mmg_3dof import Mmg3DofBasicParams, Mmg3DofManeuveringParams, simulate_mmg_3dof

GOLDEN = pathlib.Path(__file__).resolve().parent.parent / "golden"
RHO, LENGTH, DRAUGHT, VOLUME, DIAMETER = 1025.0, 7.0, 0.46, 3.27, 0.216
SHAFT_RPS, SPEED = 17.95, 2.29
STEP, SAMPLE = 0.05, 0.25
MASS = 0.5 * RHO * LENGTH**2 * DRAUGHT

BASIC = Mmg3DofBasicParams(
    L_pp=LENGTH, B=1.27, d=DRAUGHT, x_G=0.25, D_p=DIAMETER, m=VOLUME * RHO,
    I_zG=RHO * VOLUME * (0.25 * LENGTH) ** 2, A_R=0.0539, η=DIAMETER / 0.345,
    m_x=0.022 * MASS, m_y=0.223 * MASS, J_z=0.011 * MASS * LENGTH**2,
    f_α=2.747, ϵ=1.09, t_R=0.387, x_R=-0.5 * LENGTH, a_H=0.312, x_H=-0.464 * LENGTH,
    γ_R_minus=0.5175, γ_R_plus=0.5175, l_R=-0.710, κ=0.50, t_P=0.220, w_P0=0.40, x_P=-0.690,
)
HULL = Mmg3DofManeuveringParams(
    k_0=0.2931, k_1=-0.2753, k_2=-0.1385, R_0_dash=0.022,
    X_vv_dash=-0.040, X_vr_dash=0.002, X_rr_dash=0.011, X_vvvv_dash=0.771,
    Y_v_dash=-0.315, Y_r_dash=0.083, Y_vvv_dash=-1.607, Y_vvr_dash=0.379, Y_vrr_dash=-0.391, Y_rrr_dash=0.008,
    N_v_dash=-0.137, N_r_dash=-0.049, N_vvv_dash=-0.030, N_vvr_dash=-0.294, N_vrr_dash=0.055, N_rrr_dash=-0.013,
)


def simulate(rudder, u):
    """States u, v, r, x, y, psi, rudder at each step of a list of rudder angles [rad]."""
    times = [STEP * k for k in range(len(rudder))]
    found = simulate_mmg_3dof(
        BASIC, HULL, times, rudder, [SHAFT_RPS] * len(rudder), u0=u, ρ=RHO, t_eval=times, rtol=1e-7, atol=1e-9
    )
    return list(zip(*found.y))


def steps(rng, duration):
    """Steps of the rudder, at 12 degrees per second."""
    angles = [0.0]
    while len(angles) * STEP < duration:
        to = math.radians(rng.choice([-35, -25, -15, -10, -5, 0, 5, 10, 15, 25, 35]))
        hold = rng.choice([3.0, 6.0, 10.0, 20.0])
        for _ in range(round(hold / STEP)):
            change = math.radians(12.0) * STEP
            angles.append(angles[-1] + max(-change, min(change, to - angles[-1])))
    return angles


def steady():
    return simulate([0.0] * round(300 / STEP), SPEED)[-1][0]


def circle(side, u):
    states = simulate([0.0] + [side * math.radians(35.0)] * round(120 / STEP), u)
    at = lambda angle: next(state for state in states if side * state[5] >= math.radians(angle))
    quarter, half = at(90), at(180)
    return {"advance_m": quarter[3], "transfer_m": side * quarter[4], "tactical_diameter_m": side * half[4]}


def main():
    u = steady()
    circles = {"starboard": circle(1, u), "port": circle(-1, u)}
    print(u, json.dumps(circles))
    if "--write" not in sys.argv:
        return
    rng = random.Random(1)
    angles = steps(rng, 700.0)
    states = simulate(angles, u)
    every = round(SAMPLE / STEP)
    lines = ["t [s],u [m/s],v [m/s],r [rad/s],delta [deg]"]
    for k in range(0, len(states), every):
        noisy = [x + rng.gauss(0, sigma) for x, sigma in zip(states[k][:3], (0.005, 0.005, 0.001))]
        lines.append(f"{k * STEP:.2f},{noisy[0]:.4f},{noisy[1]:.4f},{noisy[2]:.5f},{math.degrees(angles[k]):.2f}")
    (GOLDEN / "tanker.csv").write_text("\n".join(lines) + "\n")
    (GOLDEN / "tanker.json").write_text(json.dumps({"speed_m_s": u, "circles": circles}, indent=1) + "\n")


main()
