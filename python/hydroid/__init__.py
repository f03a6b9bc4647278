"""Learns the dynamics of a surface vessel from its logs, and keeps learning while the vessel sails.

Velocities are ``u`` (surge, m/s), ``v`` (sway, m/s, to starboard) and ``r`` (yaw rate, rad/s, to starboard). Values are
in SI units and radians. Sample ``k`` is the measurement ``y[k]`` at ``t[k]`` and the command ``c[k]``, which is held until
``t[k + 1]``.
"""

from ._hydroid import (
    Adapter,
    Log,
    Model,
    Prediction,
    Run,
    Session,
    Step,
    __version__,
    read_log,
)
from ._evaluate import Evaluation, evaluate
from ._identify import Identification, Judgement, identify
from ._options import LogWarning
from ._logs import prepare, rollouts
from ._vessels import (
    ComparedTrack,
    Comparisons,
    Track,
    Trials,
    compare_manoeuvres,
    manoeuvres,
    simulate,
    vessel_toml,
    vessels,
)

__all__ = [
    "Adapter",
    "Evaluation",
    "Identification",
    "Judgement",
    "Log",
    "LogWarning",
    "Model",
    "Prediction",
    "Run",
    "Session",
    "Step",
    "__version__",
    "evaluate",
    "identify",
    "prepare",
    "read_log",
    "rollouts",
    # Vessels, simulated logs, manoeuvring trials
    "ComparedTrack",
    "Comparisons",
    "Track",
    "Trials",
    "compare_manoeuvres",
    "manoeuvres",
    "simulate",
    "vessel_toml",
    "vessels",
]
