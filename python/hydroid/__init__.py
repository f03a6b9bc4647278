"""Learns the dynamics of a surface vessel from its logs, and keeps learning while the vessel sails.

Velocities are ``u`` (surge, m/s), ``v`` (sway, m/s, to starboard) and ``r`` (yaw rate, rad/s, to starboard). Values are
in SI units and radians. Sample ``k`` is the measurement ``y[k]`` at ``t[k]`` and the command ``c[k]``, which is held until
``t[k + 1]``.
"""

from ._hydroid import (
    Adapter,
    ControlStep,
    Log,
    Model,
    Prediction,
    Run,
    Session,
    Step,
    __version__,
    read_log,
)
from ._control import ClosedLoop, Controller, Guard, Limits, Plan, Planner, Track, control
from ._evaluate import Evaluation, evaluate
from ._identify import Identification, Judgement, identify
from ._options import LogWarning
from ._logs import prepare, rollouts

__all__ = [
    "Adapter",
    "ClosedLoop",
    "ControlStep",
    "Controller",
    "Evaluation",
    "Guard",
    "Identification",
    "Judgement",
    "Limits",
    "Log",
    "LogWarning",
    "Model",
    "Plan",
    "Planner",
    "Prediction",
    "Run",
    "Session",
    "Step",
    "Track",
    "__version__",
    "control",
    "evaluate",
    "identify",
    "prepare",
    "read_log",
    "rollouts",
]
