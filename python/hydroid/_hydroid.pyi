"""Types of the compiled part."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._control import Guard

__version__: str

Array = NDArray[np.float64]

@final
class Log:
    """A log: named columns of numbers with their units, as they were recorded.

    Parameters
    ----------
    data : data frame or mapping of str to array_like
        Any data frame with the Arrow C interface (pandas, polars, pyarrow), or a mapping from names to arrays of one
        dimension. A name may contain a unit, ``"speed [kn]"``. Missing values are NaN or null; times become seconds
        since 1970.
    units : mapping of str to str, optional
        Units of columns.
    name : str
        Name of the log in messages.

    Raises
    ------
    TypeError, ValueError
        If a column is not an array of numbers, or the columns have different lengths; the message names the column.
    """

    def __new__(cls, data: Any, *, units: Mapping[str, str] | None = None, name: str = "log") -> Log: ...
    @property
    def name(self) -> str:
        """Name of the file without its folder."""
    @property
    def path(self) -> str:
        """Path of the file; the name of a log without a file."""
    @property
    def columns(self) -> list[str]:
        """Names of the columns, without their units."""
    @property
    def units(self) -> dict[str, str | None]:
        """Units by column; None where no unit is stated."""
    @property
    def factors(self) -> list[float]:
        """Factors from the values of the columns to SI units, 1 where no unit is known."""
    def __len__(self) -> int: ...
    def __contains__(self, name: str) -> bool: ...
    def __getitem__(self, name: str) -> Array:
        """The values of a column, shape (rows,)."""
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the log as a CSV file, in its units; `read_log` gives the same values. Missing values are ``NaN``.

        Parameters
        ----------
        path : path
        """
    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The columns for ``pyarrow.table(log)`` or ``polars.DataFrame(log)``."""

@final
class Run:
    """A run on a regular clock, in SI units. `hydroid.prepare` makes runs from logs."""

    @property
    def name(self) -> str:
        """Name of the log, with the part of it if it was cut."""
    @property
    def dt(self) -> float:
        """Sample time [s]."""
    @property
    def t(self) -> Array:
        """Time [s], shape (samples,)."""
    @property
    def outputs(self) -> Array:
        """Measurements, shape (samples, outputs); NaN is missing."""
    @property
    def inputs(self) -> Array:
        """Commands, shape (samples, inputs); row k is held until sample k + 1."""
    @property
    def heading(self) -> Array | None:
        """Heading [rad], clockwise from north, shape (samples,)."""
    @property
    def position(self) -> Array | None:
        """Position [m] in two axes, as they are in the log, shape (samples, 2); NaN where there is none."""
    @property
    def output_names(self) -> list[str]:
        """Names of the columns of `outputs`."""
    @property
    def input_names(self) -> list[str]:
        """Names of the columns of `inputs`."""
    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel; empty for a number without unit."""
    def __len__(self) -> int: ...

def read_logs(
    paths: Sequence[str | os.PathLike[str]],
    config: str | os.PathLike[str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[Log]: ...
def prepare(logs: Any, options: dict[str, Any] | None = None) -> list[Run]: ...

@final
class Model:
    """An identified model, or a vessel with given parameters.

    A model is immutable and can be pickled. `session` follows a run.
    """

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Model:
        """Read a model file, a vessel file (``.toml``), or a built-in vessel by its name (see `hydroid.vessels`).

        Parameters
        ----------
        path : path or str

        Returns
        -------
        Model
        """
    @staticmethod
    def from_bytes(bytes: bytes) -> Model:
        """A model from the bytes of its file, or a vessel from the text of its file (TOML, UTF-8).

        Parameters
        ----------
        bytes : bytes

        Returns
        -------
        Model
        """
    def to_bytes(self) -> bytes:
        """The bytes of the file; equal models have equal bytes."""
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file of the model.

        Parameters
        ----------
        path : path
            ``.safetensors``, or ``.toml`` for a vessel.
        """
    @property
    def name(self) -> str:
        """Name of the method, or of the vessel."""
    @property
    def kind(self) -> str:
        """Kind of the model: ``sparse_equations``, ``committee``, ``recurrent``, ``direct``, ``vessel``, ..."""
    @property
    def dt(self) -> float:
        """Sample time [s]."""
    @property
    def output_names(self) -> list[str]:
        """Names of the outputs, in the order of all arrays."""
    @property
    def input_names(self) -> list[str]:
        """Names of the inputs, in the order of all arrays."""
    @property
    def roles(self) -> dict[str, str]:
        """Roles of the inputs, as far as they are known: ``propulsion``, ``steering``, ``thruster``, ``disturbance``, ``setting``."""
    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel; empty for a number without unit."""
    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Design range of each channel."""
    @property
    def size(self) -> int:
        """Number of weights, or of coefficients other than zero."""
    @property
    def warm_up(self) -> int:
        """Measurements that the first prediction needs, that of the present included."""
    def equations(self) -> list[str]:
        """The equations of motion as text.

        Raises
        ------
        NotImplementedError
            If the model has no equations.
        """
    def latex(self) -> str:
        """The equations as an ``align*`` block."""
    def coefficients(self) -> list[tuple[str, str, float, float | None, str]]:
        """Output, term, value, standard error (None if unknown) and unit of each coefficient."""
    def jacobian(self, outputs: ArrayLike, inputs: ArrayLike) -> tuple[Array, Array]:
        """``A = df/dy`` (outputs, outputs) and ``B = df/dc`` (outputs, inputs) of ``dy/dt = f(y, c)``.

        The states of lags follow the outputs in `A` and `B`.

        Parameters
        ----------
        outputs : array_like, shape (outputs,)
        inputs : array_like, shape (inputs,)
        """
    def derivative(self, outputs: ArrayLike, inputs: ArrayLike | None = None) -> Array:
        """``dy/dt`` of the equations at the samples of a run, shape (samples, outputs).

        Parameters
        ----------
        outputs : array_like, shape (samples, outputs)
        inputs : array_like, shape (samples, inputs)
            Commands; None for a model without inputs. Lags of actuators follow them; until a lag has settled, the
            derivative is NaN.
        """
    def terms(
        self,
    ) -> tuple[list[list[tuple[float, list[tuple[str, str, list[float]]]]]], list[tuple[str, str, str, float]]]:
        """The equations as data.

        Returns
        -------
        equations : list
            For each output its terms ``(coefficient, factors)``; a factor is ``(variable, function, parameters)`` with
            the functions ``power`` (exponent), ``abs``, ``sign``, ``sin``, ``cos``, ``reciprocal``, ``log``, ``above``
            and ``below`` (centre and slope of a gate).
        signals : list
            Variables besides outputs and inputs, ``(name, kind, source, number)``: a ``lag`` of an actuator with its
            time constant [s], or the ``past`` value of a variable with its age [s].
        """
    def to_sympy(self) -> dict[Any, Any]:
        """The right-hand sides by output, and those of the lags, as expressions of SymPy.

        Keys and variables are real symbols with the names of the channels; a past value is a symbol of its own.
        """
    def predict(self, outputs: ArrayLike, inputs: ArrayLike | None, commands: ArrayLike) -> Array:
        """Predict the outputs after a history, shape (horizon, outputs).

        Parameters
        ----------
        outputs : array_like, shape (k + 1, outputs)
            Measurements up to the present; NaN is missing.
        inputs : array_like, shape (k, inputs)
            Commands before the present; None for a model without inputs.
        commands : array_like, shape (horizon, inputs)
            Commands from the present on.

        Returns
        -------
        ndarray, shape (horizon, outputs)
            NaN, with a warning, after fewer measurements than `warm_up`.

        Notes
        -----
        `evaluate` calls functions with the same arguments.
        """
    def simulate(
        self, start: ArrayLike, inputs: ArrayLike | None = None, *, samples: int | None = None
    ) -> Array:
        """Simulate the outputs, shape (samples, outputs), from `start`, shape (outputs,), under commands.

        A model with a warm-up does not know its state after one sample, and a warning says so.

        Parameters
        ----------
        start : array_like, shape (outputs,)
            Row 0 of the result.
        inputs : array_like, shape (samples, inputs)
            The command of row k is held until row k + 1; the last one is not used.
        samples : int
            For a model without inputs.
        """
    def weights(self) -> dict[str, NDArray[Any]]:
        """The tensors of the model file by name."""
    def frozen(self) -> Model:
        """The model whose sessions do not learn."""
    def session(self) -> Session:
        """A session at the start of a run."""
    def rollouts(
        self, logs: Any, horizon: int, stride: int, options: dict[str, Any] | None = None
    ) -> list[tuple[Run, NDArray[np.uintp], Array]]:
        """Runs, origins and predictions from them; `hydroid.rollouts` is the same with names.

        Parameters
        ----------
        logs : Log, path, data frame, mapping, Run, or list of these
        horizon, stride : int
            Samples.
        options : dict, optional
            The section ``[log]``, over that of the model.
        """

@final
class Session:
    """A session of a model on one run: ``observe(y[0])``, ``advance(c[0])``, ``observe(y[1])``, ...

    `Model.session` starts one. A copy is a `fork`; a pickle has the model and the `snapshot`.
    """

    def reset(self) -> None:
        """Return to the start of a run."""
    def observe(self, outputs: ArrayLike, heading: float | None = None) -> None:
        """Take a measurement.

        Parameters
        ----------
        outputs : array_like, shape (outputs,)
            NaN is missing.
        heading : float, optional
            Heading [rad], for a model of the motion through the water.
        """
    def advance(self, command: ArrayLike) -> None:
        """Step to the next sample under a command.

        Parameters
        ----------
        command : array_like, shape (inputs,)
        """
    @property
    def output(self) -> Array:
        """Estimate of the present outputs, shape (outputs,); NaN where there is none yet."""
    def rollout(self, commands: ArrayLike) -> Array:
        """Predict the outputs under commands. The session does not advance.

        Parameters
        ----------
        commands : array_like, shape (samples, inputs)
            From the present on.

        Returns
        -------
        ndarray, shape (samples, outputs)
            Row 0 is the next sample. It is not valid before the session has observed `Model.warm_up` samples.
        """
    def rollout_batch(self, commands: ArrayLike) -> Array:
        """Predict under several sequences of commands, side by side.

        Parameters
        ----------
        commands : array_like, shape (sequences, samples, inputs)

        Returns
        -------
        ndarray, shape (sequences, samples, outputs)
        """
    def _seconds_of_rollout_batch(self, commands: ArrayLike, repeats: int) -> float: ...
    def fork(self) -> Session:
        """An independent session with the same state."""
    def snapshot(self) -> Array:
        """All numbers that predictions depend on."""
    def restore(self, snapshot: ArrayLike) -> None:
        """Return to a snapshot of a session of the same model.

        Parameters
        ----------
        snapshot : array_like
        """

@final
class Adapter:
    def __new__(
        cls,
        model: Model,
        *,
        guard: bool | Guard | None = None,
        noise_logs: Any = None,
        **options: Any,
    ) -> Adapter: ...
    def step(self, command: ArrayLike | None, output: ArrayLike, heading: float | None = None) -> Step: ...
    def predict(self, commands: ArrayLike, horizons: Sequence[int]) -> Prediction: ...
    def reset(self) -> None: ...
    def freeze(self, frozen: bool) -> None: ...
    @property
    def weights(self) -> Array: ...
    def model(self, runs: Sequence[str] = ()) -> Model: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, state: bytes) -> None: ...

@final
class Prediction:
    """Predicted outputs at horizons."""

    @property
    def horizons(self) -> list[int]:
        """Samples after the present."""
    @property
    def outputs(self) -> Array:
        """Shape (horizons, outputs)."""
    @property
    def std(self) -> Array:
        """Standard deviation of the measurements around the predictions; NaN where it is unknown."""
    def band(self, level: float = 0.8) -> tuple[Array, Array]:
        """Ends of the band that contains the measurement with a given probability.

        Parameters
        ----------
        level : {0.8, 0.95}

        Returns
        -------
        low, high : ndarray, shape (horizons, outputs)
        """

@final
class Step:
    """What a sample did."""

    @property
    def status(self) -> str:
        """``waiting``, ``accepted``, ``inflated``, ``rejected`` or ``rolled_back``."""
    @property
    def reason(self) -> str | None:
        """Why the sample had less than full weight."""
    @property
    def estimate(self) -> Array:
        """Estimate of the outputs, shape (outputs,)."""
    @property
    def innovation(self) -> Array:
        """Measurement minus prediction; empty if there was no update."""
    @property
    def innovation_std(self) -> Array:
        """Standard deviation that the innovation was expected to have."""
    @property
    def predicted_by(self) -> str | None:
        """``adapted``, ``reference`` or ``unguarded``; None without a guard."""

@final
class ClosedLoop:
    def document(self) -> dict[str, Any]: ...
    def json(self) -> str: ...
    def metrics(self) -> dict[str, Any]: ...
    def held(self) -> bool: ...
    def csv(self) -> str: ...
    def report(self, command: str) -> str: ...
    def run(self) -> Run: ...
    def track(self) -> dict[str, Any]: ...

def options(section: str) -> list[dict[str, Any]]:
    """The options of a section: key, kind, text, and the names that the value can be."""

def control(
    plant: Model | str | os.PathLike[str],
    model: Model | str | os.PathLike[str] | None,
    options: dict[str, Any],
    guard: bool | Guard,
    training_log: Any = None,
    training_time: float = 200.0,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> ClosedLoop: ...

@final
class ControlStep:
    """What a controller did with a sample."""

    @property
    def command(self) -> Array:
        """The command until the next sample, shape (inputs,)."""
    @property
    def status(self) -> str:
        """``tracking``, ``rate_limited``, ``saturated``, ``lost``, ``singular``, ``blind``; ``arrived`` at the end of
        the path and ``stopped`` where the vessel does not come to it, with the commands at rest."""
    @property
    def arrived(self) -> bool:
        """Whether the path is at its end."""
    @property
    def pose(self) -> Array:
        """Measured or predicted pose: north, east [m] and heading [rad]; NaN is unknown."""
    @property
    def estimate(self) -> Array:
        """Estimate of the outputs, shape (outputs,)."""
    @property
    def reference(self) -> Array:
        """North, east [m], course [rad] and speed [m/s] of the reference."""
    @property
    def distance(self) -> float:
        """Distance of the controlled point from the reference [m]."""
    @property
    def cross_track(self) -> float:
        """Cross-track error of the controlled point [m], positive to starboard of the path."""

@final
class Controller:
    def __new__(
        cls,
        model: Model | str | os.PathLike[str],
        options: dict[str, Any],
        guard: bool | Guard,
        training_log: Any,
        training_time: float,
        threads: int | None,
        progress: Callable[[float], object] | None,
    ) -> Controller: ...
    def step(
        self, pose: ArrayLike, outputs: ArrayLike, samples: int = 1, gap_s: float | None = None
    ) -> ControlStep: ...
    def planned(self, samples: int) -> Array: ...
    @property
    def weights(self) -> Array: ...
    @property
    def dt(self) -> float: ...
    @property
    def output_names(self) -> list[str]: ...
    @property
    def input_names(self) -> list[str]: ...
    @property
    def limits(self) -> dict[str, tuple[float, float, float, float]]: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, state: bytes) -> None: ...

@final
class Planner:
    def __new__(
        cls,
        model: Model,
        limits: list[tuple[float, ...]],
        counts: list[int],
        weights: list[float],
        effort: list[float],
        rate: list[float],
        distances: list[float],
        seed: int,
    ) -> Planner: ...
    def plan(
        self, session: Session, pose: ArrayLike, reference: ArrayLike
    ) -> tuple[Array, Array, Array, float, int, str]: ...
    def reset(self) -> None: ...

def command_limits(model: Model) -> list[tuple[float, float, float, float]]: ...

@final
class Identification:
    def models(self) -> list[Model]: ...
    def best(self) -> int | None: ...
    def summary(self) -> dict[str, Any]: ...
    def report(self, title: str | None, command: str) -> str: ...

def identify(
    train: Any,
    validate: Any,
    test: Any,
    options: dict[str, Any],
    config: str | os.PathLike[str] | None = None,
    vessel: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Identification: ...
def evaluate(
    predictor: Union[Model, Callable[[Array, Array, Array], Any]],
    logs: Any,
    horizon: int | str,
    stride: int,
    options: dict[str, Any] | None = None,
    name: str | None = None,
    warm_up: int = 1,
    origin: str = "measured",
    against: str = "measurement",
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> dict[str, Any]: ...

# Vessels, simulated logs, manoeuvring trials

TrackArrays = tuple[Array, Array, Array, Array, Array, Array | None]

@final
class Trials:
    def document(self) -> dict[str, Any]: ...
    def inputs(self) -> tuple[list[str], list[str]]: ...
    def passed(self) -> bool: ...
    def figures(self) -> list[dict[str, Any]]: ...
    def tracks(self) -> list[tuple[int, str, TrackArrays]]: ...
    def report(self, command: str) -> str: ...
    def save(self, folder: str | os.PathLike[str], command: str) -> None: ...

@final
class Comparisons:
    def document(self) -> dict[str, Any]: ...
    def figures(self) -> list[dict[str, Any]]: ...
    def tracks(self) -> list[tuple[int, str, TrackArrays, TrackArrays]]: ...
    def report(self, command: str) -> str: ...
    def save(self, folder: str | os.PathLike[str], command: str) -> None: ...

def vessels() -> list[str]: ...
def vessel_toml(vessel: Model | str | os.PathLike[str]) -> str: ...
def simulate(
    plant: Model | str | os.PathLike[str],
    excitation: Any,
    options: dict[str, Any],
    name: str | None = None,
    figure: str | os.PathLike[str] | None = None,
    progress: Callable[[float], object] | None = None,
) -> Log: ...
def manoeuvres(
    model: Model | str | os.PathLike[str],
    options: dict[str, Any],
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Trials: ...
def compare_manoeuvres(
    model: Model | str | os.PathLike[str],
    logs: Any,
    options: dict[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Comparisons: ...
