"""Learns the dynamics of a surface vessel from its logs, and keeps learning while the vessel sails.

Velocities are ``u`` (surge, m/s), ``v`` (sway, m/s, to starboard) and ``r`` (yaw rate, rad/s, to starboard). Values are
in SI units and radians. Sample ``k`` is the measurement ``y[k]`` at ``t[k]`` and the command ``c[k]``, which is held until
``t[k + 1]``.
"""

from typing import TYPE_CHECKING, Any

from ._hydroid import (
    ControlStep,
    Log,
    Model,
    Prediction,
    Run,
    Session,
    Step,
    __version__,
)
from ._adapt import Adapter
from ._control import ClosedLoop, ClosedLoopTrack, Controller, Guard, Limits, Plan, Planner, control
from ._evaluate import Evaluation, evaluate
from ._identify import Identification, Judgement, identify
from ._options import LogWarning
from ._logs import Rollouts, prepare, read_log, read_logs, rollouts
from ._plots import plot_horizon, plot_manoeuvre, plot_rollouts, plot_track
from ._sweep import Sweep, Task, closed_loop, fit, fleet, gather, grid, random_search, sweep
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

from . import _compiled as _compiled

if TYPE_CHECKING:
    from ._estimators import GRU, LSTM, Committee, DirectPredictor, SINDy

__all__ = [
    "__version__",
    "Adapter",
    "closed_loop",
    "ClosedLoop",
    "ClosedLoopTrack",
    "Committee",
    "compare_manoeuvres",
    "ComparedTrack",
    "Comparisons",
    "control",
    "Controller",
    "ControlStep",
    "DirectPredictor",
    "evaluate",
    "Evaluation",
    "fit",
    "fleet",
    "gather",
    "grid",
    "GRU",
    "Guard",
    "Identification",
    "identify",
    "Judgement",
    "Limits",
    "Log",
    "LogWarning",
    "LSTM",
    "manoeuvres",
    "Model",
    "Plan",
    "Planner",
    "plot_horizon",
    "plot_manoeuvre",
    "plot_rollouts",
    "plot_track",
    "Prediction",
    "prepare",
    "random_search",
    "read_log",
    "read_logs",
    "Rollouts",
    "rollouts",
    "Run",
    "Session",
    "simulate",
    "SINDy",
    "Step",
    "Sweep",
    "sweep",
    "Task",
    "Track",
    "Trials",
    "vessel_toml",
    "vessels",
]

_ESTIMATORS = ("GRU", "LSTM", "Committee", "DirectPredictor", "SINDy")


def __getattr__(name: str) -> Any:
    # scikit-learn is imported by those alone who use an estimator.
    if name in _ESTIMATORS:
        from . import _estimators

        return getattr(_estimators, name)
    raise AttributeError(f"module 'hydroid' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
