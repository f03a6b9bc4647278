from __future__ import annotations

import csv
import io
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hydroid
from ._hydroid import ControlStep, Model, Run, Session
from ._identify import _write
from ._options import Bar, takes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guard:
    """Options of the guard of an adapter.

    The guard tests the adapted model beside the unchanged one (the reference) and predicts with the reference until the
    tests support the adapted model. Over the time constant `window`, the error of its predictions is at most `factor`
    times that of the adapter without guard plus `floors` times the noise, and so it is relative to the reference unless
    the measurements have favoured the adapter without guard. Faulty measurements are not used. A field that is None has
    its default.

    Parameters
    ----------
    horizon : int, optional
        Horizon of the tests [samples], a multiple of `stride`. Default: 2 s.
    stride : int, optional
        Interval of the tests [samples]. Default: a fifth of the default horizon.
    window : int, optional
        Time constant of the guarantee [samples], at least `horizon`: errors have the weight ``exp(-age / window)``.
        Default: 60 s.
    factor : float, optional
        Factor of the guarantees on the errors of the reference and of the adapter without guard, at least 1. Default: 1.2.
    floors : float, optional
        Constant of the guarantee, in standard deviations of the noise of the sensors. Default: 0.5.
    gate : float, optional
        Deviation of a measurement, relative to the usual one, above which it is not used. Default: 4.
    repeats : int, optional
        Least number of repetitions of a stuck sensor, for a sensor that has repeated values before. Default: 5.
    hold : int, optional
        Longest stretch of predictions against a measurement [samples], at least `horizon`. Default: 120 s.
    share : float, optional
        Part of this stretch that every other sample gives back. Default: 0.1.
    sensors : bool, optional
        Whether faults of the sensors are detected. Default: True.
    """

    horizon: int | None = None
    stride: int | None = None
    window: int | None = None
    factor: float | None = None
    floors: float | None = None
    gate: float | None = None
    repeats: int | None = None
    hold: int | None = None
    share: float | None = None
    sensors: bool | None = None


class ClosedLoopTrack(NamedTuple):
    """Samples of a simulated closed loop, in SI units and radians.

    Positions are in the frame of the path: north and east [m]; angles are clockwise from north [rad].
    """

    #: Time [s], shape (samples,).
    t: Array
    #: True pose: north, east [m] and heading [rad], shape (samples, 3).
    pose: Array
    #: True velocities over ground: u, v [m/s] and r [rad/s], shape (samples, 3).
    velocities: Array
    #: Measured outputs in the order of `output_names`, shape (samples, outputs).
    outputs: Array
    #: Commands in the order of `input_names`, in their units, shape (samples, inputs); row k is held until sample k + 1.
    commands: Array
    #: Reference: north, east [m] and course [rad], shape (samples, 3).
    reference: Array
    #: Speed of the reference [m/s], shape (samples,).
    reference_speed: Array
    #: Distance of the controlled point from the reference [m], shape (samples,).
    distance: Array
    #: Cross-track error [m], positive to starboard of the path, shape (samples,).
    cross_track: Array
    #: Speed over ground of the controlled point minus that of the reference [m/s], shape (samples,).
    speed_error: Array
    #: ``tracking``, ``rate_limited``, ``saturated``, ``lost``, ``singular`` or ``blind``, for each sample.
    status: list[str]
    output_names: list[str]
    input_names: list[str]


class ClosedLoop:
    """A simulated closed loop.

    Attributes
    ----------
    document : dict
        All results, as ``hydroid control --json`` prints them.
    metrics : dict
        Metrics of the run, the first one of Monte Carlo trials: ``rms_position`` [m], ``rms_cross_track`` [m],
        ``rms_speed`` [m/s], ``max_cross_track`` [m], ``settled_after`` [s], ``saturated`` (share of the samples),
        ``status`` (number of samples), ``held``, ``violations``, ...
    trials : list of dict
        ``conditions`` and ``metrics`` of each Monte Carlo trial; empty for a single run.
    track : ClosedLoopTrack
        Arrays of the run.
    held : bool
        Whether the vessel stayed on track, reached the end of an open path, and no command was beyond a limit, in all
        trials.
    """

    def __init__(self, inner: _hydroid.ClosedLoop) -> None:
        self._inner = inner
        self.document: dict[str, Any] = inner.document()
        self.metrics: dict[str, Any] = inner.metrics()
        self.trials: list[dict[str, Any]] = self.document.get("trials", [])
        self.track = ClosedLoopTrack(**inner.track())
        self.held: bool = inner.held()

    @property
    def run(self) -> Run:
        """The track as a run with commands, measured outputs and heading, for `evaluate`, `identify` or an `Adapter`."""
        return self._inner.run()

    def to_pandas(self) -> Any:
        """The track as a pandas data frame with the columns of ``track.csv``."""
        import pandas

        names, *rows = csv.reader(io.StringIO(self._inner.csv()))
        texts = dict(zip(names, zip(*rows)))
        status = texts.pop("status")
        columns = {name: [float(text) if text else np.nan for text in column] for name, column in texts.items()}
        return pandas.DataFrame({**columns, "status": status})

    def report(self) -> str:
        """The report as an HTML page."""
        return self._inner.report(" ".join(sys.argv))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``track.csv`` (a log), ``control.json`` and ``report.html`` into a folder, as ``hydroid control -o`` does."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        _write(folder / "track.csv", self._inner.csv())
        _write(folder / "control.json", self._inner.json())
        _write(folder / "report.html", self.report())

    def __repr__(self) -> str:
        controller, plant = self.document["controller"]["kind"], self.document["plant"]
        if self.trials:
            held = self.document["held"]
            return f"ClosedLoop({controller} on {plant}: {len(self.trials)} trials, {held} on track)"
        m = self.metrics
        state = "on track" if self.held else "diverged" if m["diverged"] else "not on track"
        errors = ", ".join(
            f"RMS {what} {'-' if m[key] is None else format(m[key], '.4g')} {unit}"
            for what, key, unit in (
                ("position", "rms_position", "m"),
                ("cross-track", "rms_cross_track", "m"),
                ("speed", "rms_speed", "m/s"),
            )
        )
        return f"ClosedLoop({controller} on {plant}: {state}; {errors} after {m['from_s']:.4g} s)"


@takes("control")
def control(
    plant: Model | str | os.PathLike[str],
    model: Model | str | os.PathLike[str] | None = None,
    *,
    guard: bool | Guard = True,
    training_log: Any = None,
    training_time: float = 200.0,
    threads: int | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> ClosedLoop:
    """Simulate a closed loop: a controller with a model, on a plant with noise, current, wind and delay.

    The options are those of the command ``hydroid control`` and have its defaults; equal options and seeds give equal
    tracks. Defaults of an identified model are in proportion to its size, which follows from simulated tests.

    Parameters
    ----------
    plant : Model or path
        The true plant: an identified model, a vessel file, or ``"hydrofoil"``, ``"hydrofoil-low-speed"``, ``"simple"``.
    model : Model or path, optional
        The model of the controller. Default: the plant.
    **options
    guard : bool or Guard
        Guard of the adaptation.
    training_log : Log, path, data frame, mapping, Run, or list of these, optional
        Logs of the training of the model: the filter runs over the first `training_time` seconds of each first.
    training_time : float
        [s]
    threads : int, optional
        Default: all cores. The result does not depend on it.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    TypeError, ValueError
        If an option has the wrong type, has no effect, or does not fit model and plant; the message names it.
    FileNotFoundError, OSError
        If a file cannot be read.

    Examples
    --------
    >>> loop = hydroid.control("hydrofoil", controller="fl", speed=4.0, radius=30.0)
    >>> loop.metrics["rms_position"]
    """
    with Bar(progress, "simulating") as bar:
        inner = _hydroid.control(
            plant, model, options, guard, training_log, training_time, threads, bar.callback
        )
    return ClosedLoop(inner)


@takes("control")
class Controller:
    """A controller on board: from each sample to a command, along the path of a task.

    It is built as that of ``hydroid control MODEL -``. Its model follows the vessel, fills in missing measurements, and
    learns with ``adapt=True``. A missing position or heading is predicted from the velocities, and a missing velocity is
    that of the model, for ``max_age`` (default: 1 s, at least 5 samples); then the controller is blind, and the commands
    have their neutral values. The time is that of the calls: a program that has no sample sends its own neutral command.
    The reference waits while the vessel is farther from it than `tolerance`. It is refused if the role of an input is not
    known, or neutral values or limits only follow from the logs of the model: state them with ``role``, ``neutral`` and
    ``limit``.

    Parameters
    ----------
    model : Model or path
        A model with the outputs u, v and r that can be adapted: equations, a committee, a recurrent network, a direct
        predictor or a vessel. An autopilot (``pid``) is tuned on it first.
    guard, training_log, training_time, threads, progress
        As for `control`.
    **options

    Notes
    -----
    Options of the simulation are refused. Positions are relative to the origin of the path: north and east [m].

    Raises
    ------
    TypeError, ValueError
        As `control`.

    Examples
    --------
    >>> controller = hydroid.Controller(model, task="waypoints", points=[(0, 0), (60, 0), (60, 40)])
    >>> step = controller.step([0.0, 0.0, 0.0], [1.2, 0.0, 0.0])
    >>> step.command, step.status
    """

    def __init__(
        self,
        model: Model | str | os.PathLike[str],
        *,
        guard: bool | Guard = True,
        training_log: Any = None,
        training_time: float = 200.0,
        threads: int | None = None,
        progress: bool | Callable[[float], object] = False,
        **options: Any,
    ) -> None:
        with Bar(progress, "tuning") as bar:
            self._inner = _hydroid.Controller(
                model, options, guard, training_log, training_time, threads, bar.callback
            )

    def step(
        self, pose: ArrayLike, outputs: ArrayLike, *, samples: int = 1, gap_s: float | None = None
    ) -> ControlStep:
        """Compute the command from now on until the next sample.

        Parameters
        ----------
        pose : array_like, shape (3,)
            North, east [m] and heading, clockwise from north [rad]; NaN is missing.
        outputs : array_like, shape (outputs,)
            Measured outputs in the order of `output_names`: u, v [m/s], r [rad/s], ... NaN is missing.
        samples : int
            Samples of `dt` since the last call, at most those of the longest gap of a run.
        gap_s : float, optional
            Time since the last call [s] if it is longer: a new run begins, and the path is continued from the nearest
            point that the reference can have reached.

        Returns
        -------
        ControlStep
        """
        return self._inner.step(pose, outputs, samples, gap_s)

    def planned(self, samples: int) -> Array:
        """Commands that are planned for the next samples, shape (samples, inputs); the first is that of the last step.

        Without a plan (``fl``, ``backstepping``, ``pid``) the command is held.
        """
        return self._inner.planned(samples)

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self._inner.dt

    @property
    def output_names(self) -> list[str]:
        """Names of the outputs of `step`."""
        return self._inner.output_names

    @property
    def input_names(self) -> list[str]:
        """Names of the commands."""
        return self._inner.input_names

    @property
    def limits(self) -> dict[str, Limits]:
        """Limits of each command."""
        return {name: Limits(*limits) for name, limits in self._inner.limits.items()}

    @property
    def weights(self) -> Array:
        """Weights with which the model predicts."""
        return self._inner.weights

    @property
    def state(self) -> bytes:
        """Everything on which later commands depend. It can be set for a controller of the same model and options."""
        return self._inner.state

    @state.setter
    def state(self, state: bytes) -> None:
        self._inner.state = state

    def __repr__(self) -> str:
        return repr(self._inner)


class Limits(NamedTuple):
    """Limits of a command, in its unit."""

    low: float
    high: float
    #: Largest rate of change, per second.
    rate: float
    #: Value at rest.
    rest: float


class Plan(NamedTuple):
    """A plan of the cross-entropy method."""

    #: The command until the next sample, shape (inputs,).
    command: Array
    #: Commands of all samples of the horizon, shape (samples, inputs); the first row is `command`.
    commands: Array
    #: Outputs after each of these commands, predicted by the session, shape (samples, outputs).
    outputs: Array
    #: Cost of the plan; infinite if no candidate has a finite prediction.
    cost: float
    #: Number of rollouts; 0 while a command of the last plan is held.
    rollouts: int
    #: ``tracking``, ``rate_limited``, ``saturated``, ``lost`` or ``blind``.
    status: str


class Planner:
    """Model predictive control by the cross-entropy method, for any reference.

    A plan is a command for each of `horizon` steps of `hold` samples. The cost of a plan is the mean over the ends of
    its commands of::

        position |p - p_d|^2 + course 2 (1 - cos(chi - chi_d)) + speed (|nu| - U_d)^2
        + sum_i effort_i ((c_i - rest_i) / s_i)^2 + rate_i (dc_i / s_i)^2

    with the point p `lead` metres ahead of the origin, the course over ground chi (the heading at a reference at rest),
    and half of the range of a command s_i. `Controller` plans along the path of a task; this class plans for references
    and a session of the model that the caller supplies.

    Parameters
    ----------
    model : Model
        A model whose first outputs are u, v and r.
    horizon : int
        Commands of a plan.
    hold : int
        Samples for which a command of a plan is held; a new plan is made when it ends.
    candidates, iterations : int
        Candidates of each iteration, of which a tenth (at least 2) are elites, and iterations.
    gauss_newton_steps : int
        Gauss-Newton steps from the best candidate.
    cost_weights : (float, float, float)
        Weights of position error [1/m^2], course error [1/rad^2] and speed error [s^2/m^2].
    effort, change : mapping of str to float, optional
        Weights of commands (default 0) and of their changes (default 0.05), relative to half of their range.
    limit : mapping of str to (float, float), optional
        Limits of commands, in their units. Default: the design range of the model.
    rate_limit, neutral : mapping of str to float, optional
        Largest rate of change of commands, in their unit per second, and their values at rest.
    lead : float
        Distance of the controlled point ahead of the origin [m].
    tolerance : float
        Distance from the reference beyond which the status is ``lost`` [m].
    seed : int
        Equal seeds and calls give equal plans.

    References
    ----------
    R. Y. Rubinstein and D. P. Kroese, The Cross-Entropy Method, 2004; C. Pinneri et al., Sample-efficient cross-entropy
    method for real-time planning, 2020.

    Examples
    --------
    >>> planner, session = hydroid.Planner(model, horizon=40), model.session()
    >>> session.observe(y)
    >>> plan = planner.plan(session, pose, reference)
    >>> session.advance(plan.command)
    """

    def __init__(
        self,
        model: Model,
        *,
        horizon: int = 20,
        hold: int = 1,
        candidates: int = 60,
        iterations: int = 2,
        gauss_newton_steps: int = 2,
        cost_weights: Sequence[float] = (1.0, 0.2, 0.2),
        effort: Mapping[str, float] | None = None,
        change: Mapping[str, float] | None = None,
        limit: Mapping[str, tuple[float, float]] | None = None,
        rate_limit: Mapping[str, float] | None = None,
        neutral: Mapping[str, float] | None = None,
        lead: float = 0.0,
        tolerance: float = 2.0,
        seed: int = 0,
    ) -> None:
        inputs = model.input_names
        limits = {name: list(of) for name, of in zip(inputs, _hydroid.command_limits(model))}
        for name, (low, high) in _of(inputs, "limit", limit).items():
            limits[name][:2] = [float(low), float(high)]
            # The model's value at rest may be outside.
            limits[name][3] = min(max(limits[name][3], float(low)), float(high))
        for name, rate in _of(inputs, "rate_limit", rate_limit).items():
            limits[name][2] = float(rate)
        for name, rest in _of(inputs, "neutral", neutral).items():
            limits[name][3] = float(rest)
        efforts, changes = _of(inputs, "effort", effort), _of(inputs, "change", change)
        self.horizon, self.hold = horizon, hold
        self.limits = {name: Limits(*of) for name, of in limits.items()}
        self._inner = _hydroid.Planner(
            model,
            [tuple(of) for of in limits.values()],
            [horizon, hold, candidates, iterations, gauss_newton_steps],
            list(cost_weights),
            [float(efforts.get(name, 0.0)) for name in inputs],
            [float(changes.get(name, 0.05)) for name in inputs],
            [lead, tolerance],
            seed,
        )

    def plan(self, session: Session, pose: ArrayLike, reference: ArrayLike) -> Plan:
        """Plan from a pose and the present state of a session, or continue the last plan while a command is held.

        Parameters
        ----------
        session : Session
            A session of the model that has observed the present sample. It does not advance.
        pose : array_like, shape (3,)
            North, east [m] and heading, clockwise from north [rad].
        reference : array_like, shape (horizon, 4)
            North, east [m], course [rad] and speed [m/s] at the end of each command of the plan: after ``hold``,
            ``2 hold``, ... samples.
        """
        return Plan(*self._inner.plan(session, pose, reference))

    def reset(self) -> None:
        """Return to a plan at rest and to the seed."""
        self._inner.reset()


def _of(inputs: list[str], argument: str, given: Mapping[str, Any] | None) -> dict[str, Any]:
    """A mapping from names of inputs."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise TypeError(f"{argument}: expected a mapping from names of inputs, got {type(given).__name__}")
    for name in given:
        if name not in inputs:
            raise ValueError(f"{argument}: expected some of {', '.join(inputs)}, got {name!r}")
    return dict(given)
