"""
@TITLE@

Written by hydroid @VERSION@. The class has the interface of the vehicles of the Python Vehicle Simulator (T. I. Fossen) and
needs numpy alone.

    vehicle = @CLASS@("stepInput", command, V_current, beta_current)
        command: row of the commands below that stepInput(t) returns (default: their neutral values)
        V_current, beta_current: speed [m/s] and direction [deg] of the current

    nu, u_actual = vehicle.dynamics(eta, nu, u_actual, u_control, sampleTime)
        eta: x, y, z [m], phi, theta, psi [rad]; nu: u, v, w [m/s], p, q, r [rad/s]. Surge, sway and yaw move.
        u_control: the commands

Commands (unit, lowest and highest value, neutral value):
@COMMANDS@

Equations (body frame forward, starboard, down, nu = (u, v, r) relative to the water; T. I. Fossen, Handbook of Marine Craft
Hydrodynamics and Motion Control, 2021, chapter 6; rudders: MMG standard method, Yasukawa and Yoshimura 2015):

    M dnu/dt + C(nu) nu + D(nu) nu = sum of thrusters + sum of rudders
"""
import math

import numpy as np

NAME = @NAME@
LENGTH, BEAM = @LENGTH@, @BEAM@  # m
WATER_DENSITY = @DENSITY@  # kg/m^3

# m11, m22, m23, m33: m - X_udot, m - Y_vdot, m x_g - Y_rdot, I_z - N_rdot.
MASS = @MASS@
# m22 - m11, or 0 for a vessel without the Munk moment.
MUNK = @MUNK@
# Rows X, Y, N; columns u, v, r. Entry (i, j) resists with linear nu_j + quadratic |nu_j| nu_j.
LINEAR = @LINEAR@
QUADRATIC = @QUADRATIC@
# Rows Y, N; columns v, r. Entry (i, j) resists with |u| nu_j.
LIFT = @LIFT@
CROSS_FLOW = @CROSS_FLOW@  # 1/2 rho T C_d
# Mass matrix while flying, factor of the damping, transition speed [m/s], slope [s/m]; None for a vessel that does not fly.
FLYING = @FLYING@

COMMANDS = @COMMAND_DATA@
SERVOS = @SERVOS@
THRUSTERS = @THRUSTERS@
RUDDERS = @RUDDERS@
# Yaw moment gain u a, or gain u sin(a), of the position a.
HELMS = @HELMS@

STEP = @STEP@  # s, longest step of the integration


def _inverse(mass):
    m11, m22, m23, m33 = mass
    determinant = m22 * m33 - m23 * m23
    return 1.0 / m11, m33 / determinant, -m23 / determinant, m22 / determinant


def _solve(inverse, force):
    i11, i22, i23, i33 = inverse
    x, y, n = force
    return np.array([i11 * x, i22 * y + i23 * n, i23 * y + i33 * n])


def _order(servo, command):
    terms = zip(servo["commands"], servo["neutral"], servo["gain"])
    total = sum(gain * (command[c] - neutral) for c, neutral, gain in terms)
    return min(max(total, servo["low"]), servo["high"])


def _moved(servo, position, order, h):
    """The position after h seconds under an order: da/dt = sat((order - a) / lag, rate), exactly."""
    lag, rate, error = servo["lag"], servo["rate"], order - position
    if error == 0.0 or (lag == 0.0 and math.isinf(rate)):
        return order
    knee = rate * lag
    if abs(error) <= knee:
        return order - error * math.exp(-h / lag)
    side = math.copysign(1.0, error)
    ramp = (abs(error) - knee) / rate
    if ramp >= h:
        return position + side * rate * h
    return order - side * knee * math.exp(-(h - ramp) / lag) if lag > 0.0 else order


def _cross_flow(v, r):
    """Integrals of |w| w and x |w| w over the hull, w = v + x r."""
    half = 0.5 * LENGTH
    if abs(v) >= abs(r) * half:
        cubed = 2.0 * half**3 / 3.0
        side = -1.0 if v < 0.0 else 1.0
        return side * (v * v * 2.0 * half + r * r * cubed), v * r * 2.0 * cubed * side
    fore, aft = v + r * half, v - r * half
    cubes = fore * fore * abs(fore), aft * aft * abs(aft)
    force = (cubes[0] - cubes[1]) / (3.0 * r)
    fourth = (cubes[0] * fore - cubes[1] * aft) / (4.0 * r * r)
    return force, fourth - v * force / r


def damping(nu):
    """D(nu) nu [N, N, N m]."""
    u, v, r = nu
    force = np.dot(LINEAR, nu) + np.dot(QUADRATIC, np.abs(nu) * nu)
    force[1:] += abs(u) * np.dot(LIFT, nu[1:])
    if CROSS_FLOW > 0.0 and LENGTH > 0.0:
        force[1:] += CROSS_FLOW * np.array(_cross_flow(v, r))
    return force


def _thrust(thruster, position, advance):
    n = abs(position) - thruster["dead_band"]
    if n <= 0.0:
        return 0.0
    gain = thruster["forward"] if position > 0.0 else -thruster["reverse"]
    return gain * (n * n if thruster["quadratic"] else n) - thruster["speed_loss"] * n * advance


def actuators(nu, positions):
    """Force of the thrusters and rudders [N, N, N m] at the positions of the servos."""
    u, v, r = nu
    tau = np.zeros(3)
    thrusts = []
    for thruster in THRUSTERS:
        angle = thruster["angle"]
        if thruster["steering"] is not None:
            angle += positions[thruster["steering"]]
        x, y = thruster["position"]
        sin, cos = math.sin(angle), math.cos(angle)
        advance = (u - y * r) * cos + (v + x * r) * sin
        thrust = _thrust(thruster, positions[thruster["servo"]], advance)
        thrusts.append((thrust, advance, thruster["diameter"]))
        tau += thrust * np.array([cos, sin, x * sin - y * cos])
    for rudder in RUDDERS:
        x, y = rudder["position"]
        angle = positions[rudder["servo"]]
        sin, cos = math.sin(angle), math.cos(angle)
        inflow = (u - y * r) * (1.0 - rudder["wake"])
        if rudder["thruster"] is not None:
            thrust, advance, diameter = thrusts[rudder["thruster"]]
            if thrust > 0.0:
                disc = 0.25 * math.pi * diameter * diameter
                behind = math.sqrt(advance * advance + thrust / (0.5 * WATER_DENSITY * disc))
                inflow += rudder["race"] * (behind - abs(advance))
        across = (v + x * r) * rudder["straightening"]
        area = 0.5 * WATER_DENSITY * rudder["area"] * rudder["lift_slope"]
        normal = area * math.hypot(inflow, across) * (inflow * sin + across * cos)
        along = -normal * (1.0 - rudder["drag_deduction"]) * sin
        aside = -normal * cos
        hull = rudder["hull_force"]
        tau += [along, aside * (1.0 + hull), aside * (x + hull * rudder["hull_position"]) - y * along]
    for helm in HELMS:
        angle = positions[helm["servo"]]
        tau[2] += helm["gain"] * u * (math.sin(angle) if helm["sine"] else angle)
    return tau


def acceleration(nu, positions):
    """dnu/dt [m/s^2, m/s^2, rad/s^2] of nu = (u, v, r) through the water at the positions of the servos."""
    u, v, r = nu
    m11, m22, m23, _ = MASS
    coriolis = np.array([-(m22 * v + m23 * r) * r, m11 * u * r, MUNK * u * v + m23 * u * r])
    driving, drag = actuators(nu, positions) - coriolis, damping(nu)
    normal = _solve(_inverse(MASS), driving - drag)
    if FLYING is None:
        return normal
    flying = _solve(_inverse(FLYING["mass"]), driving - FLYING["drag_factor"] * drag)
    distance = FLYING["slope"] * (u - FLYING["transition_speed"])
    weight = 0.5 * (1.0 + math.tanh(0.5 * distance))
    return weight * flying + (1.0 - weight) * normal


def settled(command):
    """The positions of the servos that hold a row of commands."""
    return np.array([_order(servo, command) for servo in SERVOS])


def _stages(servo, position, order, h):
    """Positions at the stages of the Runge-Kutta method and at the end of a step."""
    if servo["exact"]:
        at_once = servo["lag"] == 0.0 and math.isinf(servo["rate"])
        middle = _moved(servo, position, order, 0.5 * h)
        last = _moved(servo, middle, order, 0.5 * h)
        return (order if at_once else position), middle, middle, last, last
    # A state of the equations of motion, integrated with them: da/dt = (order - a) / lag.
    k1 = (order - position) / servo["lag"]
    second = position + 0.5 * h * k1
    k2 = (order - second) / servo["lag"]
    third = position + 0.5 * h * k2
    k3 = (order - third) / servo["lag"]
    fourth = position + h * k3
    k4 = (order - fourth) / servo["lag"]
    return position, second, third, fourth, position + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


def advance(nu, positions, command, h):
    """nu = (u, v, r) and the positions after a step of h seconds with the commands held, by the Runge-Kutta method of
    order 4."""
    stages = [_stages(*of, h) for of in zip(SERVOS, positions, settled(command))]
    first, second, third, fourth, last = np.array(stages).T
    k1 = acceleration(nu, first)
    k2 = acceleration(nu + 0.5 * h * k1, second)
    k3 = acceleration(nu + 0.5 * h * k2, third)
    k4 = acceleration(nu + h * k3, fourth)
    return nu + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), last
