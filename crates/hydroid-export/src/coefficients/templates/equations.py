"""
@TITLE@

Written by hydroid @VERSION@. The class has the interface of the vehicles of the Python Vehicle Simulator (T. I. Fossen) and
needs numpy alone.

    vehicle = @CLASS@("stepInput", command, V_current, beta_current)
        command: row of the commands below that stepInput(t) returns (default: their neutral values)
        V_current, beta_current: speed [m/s] and direction [deg] of the current

    nu, u_actual = vehicle.dynamics(eta, nu, u_actual, u_control, sampleTime)
        eta: x, y, z [m], phi, theta, psi [rad]; nu: u, v, w [m/s], p, q, r [rad/s]. Surge, sway and yaw move.
        u_control: the commands c

Commands (unit, lowest and highest value, neutral value):
@COMMANDS@
"""
import math

import numpy as np

NAME = @NAME@
LENGTH, BEAM = 0.0, 0.0  # not known

COMMANDS = @COMMAND_DATA@
# Lags s of commands: ds/dt = (c - s) / time.
LAGS = @LAGS@

STEP = @STEP@  # s, longest step of the integration


def acceleration(nu, s, c):
    """dnu/dt [m/s^2, m/s^2, rad/s^2] of nu = (u, v, r) with the lags s and the commands c."""
    u, v, r = nu
    return np.array([
@ACCELERATIONS@
    ])


def settled(command):
    """The lags that hold a row of commands."""
    return np.array([command[lag["command"]] for lag in LAGS], float)


def advance(nu, lags, command, h):
    """nu = (u, v, r) and the lags after a step of h seconds with the commands held: velocities by the Runge-Kutta method of
    order 4, lags exactly."""
    orders, times = settled(command), np.array([lag["time"] for lag in LAGS], float)
    middle = orders + (lags - orders) * np.exp(-0.5 * h / times)
    last = orders + (lags - orders) * np.exp(-h / times)
    k1 = acceleration(nu, lags, command)
    k2 = acceleration(nu + 0.5 * h * k1, middle, command)
    k3 = acceleration(nu + 0.5 * h * k2, middle, command)
    k4 = acceleration(nu + h * k3, last, command)
    return nu + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), last
