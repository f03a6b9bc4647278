"""Estimators with the interface of scikit-learn; runs are given as PySINDy takes them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hydroid
from ._compiled import warn_of_warm_up
from ._evaluate import Evaluation, evaluate
from ._hydroid import Log, Model, Run
from ._identify import Identification, identify
from ._options import Channels

try:
    from sklearn.base import BaseEstimator
    from sklearn.utils.validation import check_array, check_is_fitted
except ImportError as error:
    raise ImportError("the estimators need scikit-learn: pip install scikit-learn") from error

Runs = Union[ArrayLike, Log, Run, Sequence[Any]]

#: Parameters that are not options of the method.
_COMMON = ("dt", "horizon", "outputs", "inputs", "log", "random_state", "n_jobs")


_COMMON_TEXT = """\
    dt : float, optional
        Sample time [s] of runs that are arrays, where `fit` has no `t`.
    horizon : int or str, optional
        Longest horizon: samples, or seconds as ``"10s"``. Default: 100 samples, or fewer for short runs.
    outputs, inputs : optional
        Channels of runs that are logs; see `hydroid.prepare`.
    log : mapping, optional
        Further options of `hydroid.prepare`.
    random_state : int
    n_jobs : int, optional
        Threads; default: all cores. The result does not depend on it.

    Attributes
    ----------
    model_ : hydroid.Model or None
    reason_ : str or None
        Why there is no model.
    identification_ : hydroid.Identification
    horizon_ : int or str
        Longest horizon of the score.
    n_features_in_ : int
        Number of outputs.
    """


class _Dynamics(BaseEstimator):  # type: ignore[misc]
    """An estimator over `identify` with one method. Its parameters besides the common ones are options of the method."""

    _method: str

    # Set by the constructors of the subclasses.
    dt: float | None
    horizon: int | str | None
    outputs: Channels | None
    inputs: Channels | None
    log: Mapping[str, Any] | None
    random_state: int
    n_jobs: int | None

    #: After `fit`. There is no model if `reason_` is a text.
    model_: Model | None
    identification_: Identification
    horizon_: int | str
    reason_: str | None

    #: Columns of the data frames of `fit`, and factors from the units of names to SI units.
    _columns: tuple[list[str] | None, list[str] | None] = (None, None)
    _factors: tuple[Any, Any] = (1.0, None)

    def fit(
        self,
        x: Runs,
        y: Any = None,
        *,
        t: Any = None,
        u: Any = None,
        feature_names: Sequence[str] | None = None,
        **unknown: Any,
    ) -> Any:
        """Identify the dynamics from runs.

        Parameters
        ----------
        x : array_like (samples, outputs), Log, Run or path, or list of these
            A list, or an array (runs, samples, outputs), has a run for each item. The columns of a data frame are the
            names of the outputs.
        y : optional
            The sample time or ascending times, as the second argument of PySINDy's `fit`, where the parameter `dt` is
            None; with `dt`, what scikit-learn may pass is not used.
        t : float or array_like (samples,), or list of these
            Sample time, or times of the samples [s], or dates; default: the index of a data frame if it has dates,
            or the parameter `dt`. Logs have their own times.
        u : array_like (samples, inputs) or (samples,), function of time, or list of these, optional
            Commands; row k is held until sample k + 1. A function is called with the times [s]; a smooth one that changes
            between samples needs shorter sample times, or ``central_differences=True``.
        feature_names : list of str, optional
            Names of outputs and inputs; default: those of data frames, or x0, x1, .. and u0, u1, .. Values are in the
            units of the names, ``"v [kn]"``, here and later; predictions are in SI units.
        **unknown
            Refused; the message says what takes the place of an argument of PySINDy.

        Returns
        -------
        self
            If nothing could be fitted, `model_` is None, `reason_` and a warning say why, predictions and score are NaN. Equations
            that explain the data to within their noise, and diverge from measured states, have a warning and the score
            minus infinity.
        """
        for argument in unknown:
            remedy = _REMEDIES.get(argument, "the arguments are x, t, u and feature_names")
            raise TypeError(f"{argument}: {type(self).__name__}.fit does not take it; {remedy}")
        t = self._times(x, y, t)
        # What fails leaves no model of earlier data.
        for name in ("model_", "identification_", "reason_", "horizon_", "n_features_in_", "feature_names_in_"):
            self.__dict__.pop(name, None)
        self._columns, self._factors = (None, None), (1.0, None)
        logs, outputs, inputs = self._logs(x, t, u, feature_names, least=3)
        options = {
            name: value
            for name, value in self.get_params(deep=False).items()
            if name not in _COMMON and value is not None
        }

        def identified(horizon: int | str | None) -> Identification:
            return identify(
                logs,
                outputs=self.outputs if outputs is None else outputs,
                inputs=self.inputs if inputs is None else inputs or "none",
                methods=self._method,
                horizon=horizon,
                seed=self.random_state,
                log=self.log,
                sections={self._method: options} if options else None,
                threads=_threads(self.n_jobs),
            )

        found, error = None, None
        try:
            found = identified(self.horizon)
        except ValueError:
            if self.horizon is not None:
                raise
        if self.horizon is None and (found is None or not found.models):
            # The parts that are left out of short runs may have fewer samples than the default horizon.
            try:
                found = identified(1)
            except ValueError as failed:
                if found is None:
                    raise
                error = failed
            if found.models:
                warnings.warn("the runs are short: the model is chosen by predictions of one sample", stacklevel=2)
        assert found is not None
        best = found.best
        fitted = next(iter(found.models.values()), None)
        explained = any(model.get("noise_ratio") for model in found.summary["models"])
        if best is None and (explained or found.not_enough_data is not None):
            # Equations that explain the data and diverge from measured states, or a model with too few data to judge it.
            best = fitted
        self.identification_ = found
        self.model_ = best
        self.reason_ = None
        if best is None:
            messages = "; ".join(warning["message"] for warning in found.warnings)
            self.reason_ = f"no model was found: {error or messages or 'every model diverged'}"
            if found.models:
                self.reason_ += "; identification_.models has what was fitted"
            warnings.warn(self.reason_, stacklevel=2)
        judged = next(iter(found.judgement.values()), None)
        last = [] if judged is None else judged.validation.horizons.tolist()
        self.horizon_ = self.horizon if self.horizon is not None else last[-1] if last else 1
        names = outputs if best is None else best.output_names
        if names is not None:
            self.n_features_in_ = len(names)
        return self

    def _times(self, x: Runs, y: Any, t: Any) -> Any:
        """The times of the runs, which PySINDy takes as the second argument."""
        if t is not None or y is None or self.dt is not None or _is_own(x):
            return t
        if not _is_time(y):
            raise ValueError("y: expected the sample time or ascending times [s]; or name them: t=..")
        return y

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "model_")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # A missing measurement.
        tags.input_tags.allow_nan = True
        return tags

    @property
    def min_context(self) -> int:
        """Samples that the first prediction needs; earlier ones are NaN."""
        return self._found().warm_up

    def _found(self) -> Model:
        check_is_fitted(self)
        if self.model_ is None:
            raise ValueError(self.reason_)
        return self.model_

    def predict(self, x: Runs, u: Any = None) -> Any:
        """Predict each sample from those before it.

        Parameters
        ----------
        x : as in `fit`
        u : array_like (samples, inputs) or list of these, optional

        Returns
        -------
        ndarray (samples, outputs), or list of these
            Row k is the output at sample k + 1, predicted from the measurements and commands up to sample k. Rows
            before sample `min_context` are NaN, and a warning says so.
        """
        return self._each(x, u, _next_outputs)

    def _each(self, x: Runs, u: Any, function: Callable[[Model, Any, Any], NDArray[np.float64]]) -> Any:
        check_is_fitted(self)
        if self.model_ is None:
            return self._undefined(x, "predictions are")
        model = self._found()
        if not _is_own(x):
            items, several = _items(x)
            commands = _matched("u", u, len(items), several)
            q, m = len(model.output_names), len(model.input_names)
            name = type(self).__name__
            of_x, of_u = self._factors
            results = []
            for a, b in zip(items, commands):
                self._check_columns(a, b)
                if function is _next_outputs:
                    _check_clock(a, model.dt)
                results.append(function(model, of_x * _table("x", a, q, name), _scaled(_table("u", b, m, name), of_u)))
        else:
            several = isinstance(x, (list, tuple))
            runs = self._prepared(x)
            results = [function(model, run.outputs, run.inputs) for run in runs]
        return results if several else results[0]

    def _undefined(self, x: Runs, what: str) -> Any:
        """NaN in place of predictions, where no model was found."""
        if _is_own(x):
            raise ValueError(self.reason_)
        items, several = _items(x)
        blank = [np.full_like(_table("x", item, self.n_features_in_, type(self).__name__), np.nan) for item in items]
        warnings.warn(f"{what} NaN: {self.reason_}", stacklevel=4)
        return blank if several else blank[0]

    def _prepared(self, x: Any) -> list[Run]:
        given = x if isinstance(x, (list, tuple)) else [x]
        if all(isinstance(item, Run) for item in given):
            return list(given)
        model = self._found()
        options = {"outputs": model.output_names, "inputs": model.input_names, **(self.log or {})}
        return _hydroid.prepare(list(given), options)

    def score(self, x: Runs, y: Any = None, *, t: Any = None, u: Any = None) -> float:
        """Mean R² of predictions from origins along runs, over all horizons up to `horizon` and all outputs.

        Parameters
        ----------
        x, t, u : as in `fit`
        y : optional
            As in `fit`.

        Returns
        -------
        float
            Minus infinity for a model that diverges, NaN if no model was found.
        """
        check_is_fitted(self)
        if self.model_ is None:
            self._undefined(x, "the score is")
            return float("nan")
        judged = self.evaluate(x, t=self._times(x, y, t), u=u)
        return float("-inf") if judged.diverged else float(np.nanmean(judged.r2))

    def evaluate(self, x: Runs, *, t: Any = None, u: Any = None, **options: Any) -> Evaluation:
        """Judge the model on runs.

        Parameters
        ----------
        x, t, u : as in `fit`
        **options
            Those of `hydroid.evaluate`.

        Returns
        -------
        Evaluation
        """
        model = self._found()
        outputs, inputs = model.output_names, model.input_names
        if inputs and u is None and not _is_own(x):
            raise ValueError(f"u: expected the commands {', '.join(inputs)}, got None; or give runs as hydroid.Log")
        logs, _, _ = self._logs(x, t, u, [*outputs, *inputs], width=len(outputs), is_new=False)
        for log in [] if _is_own(x) else logs:
            steps = np.diff(log[log.columns[0]])
            if steps.size and not np.isclose(np.median(steps), model.dt, rtol=1e-3, atol=0.0):
                raise ValueError(
                    f"t: expected the sample time of the model, {model.dt:g} s, got {np.median(steps):g} s"
                )
        return evaluate(model, logs, **{"horizon": self.horizon_, "threads": _threads(self.n_jobs), **options})

    def simulate(self, x0: ArrayLike, t: Any, u: Any = None) -> NDArray[np.float64]:
        """Simulate the outputs from `x0` under commands.

        Parameters
        ----------
        x0 : array_like (outputs,)
        t : array_like (samples,) or int
            Times with the sample time of the model [s], or the number of samples.
        u : array_like (samples, inputs), or function of time, optional

        Returns
        -------
        ndarray (samples, outputs)
            Row 0 is `x0`.
        """
        model = self._found()
        if isinstance(t, (int, np.integer)):
            times = model.dt * np.arange(int(t))
        else:
            times = np.atleast_1d(np.asarray(_seconds(t), dtype=np.float64))
            steps = np.diff(times)
            if np.ndim(t) != 1 or steps.size and not np.allclose(steps, model.dt, rtol=1e-3, atol=0.0):
                found = f"steps of {np.median(steps):g} s" if steps.size else f"shape {np.shape(t)}"
                raise ValueError(f"t: expected times with the sample time of the model, {model.dt:g} s, got {found}")
        inputs = _called(u, times)
        of_x, of_u = self._factors
        if inputs is not None:
            inputs = _scaled(_table("u", inputs, len(model.input_names), type(self).__name__), of_u)
        start = np.asarray(x0, dtype=np.float64)
        # A start of another shape is refused by the model.
        start = of_x * start if start.shape == np.shape(of_x) else start
        return model.simulate(start, inputs, samples=len(times))

    def _check_columns(self, x: Any, u: Any) -> None:
        """Refuses data frames whose columns are not those of `fit`, as scikit-learn does, or whose dates differ."""
        for argument, given, known in zip("xu", (x, u), self._columns):
            names = _frame_names(given)
            if names is not None and known is not None and names != known:
                raise ValueError(
                    f"{argument}: the columns should be those of fit, in the same order: expected {', '.join(known)}, "
                    f"got {', '.join(names)}"
                )
        dates = [_dates(frame) for frame in (x, u)]
        if all(date is not None for date in dates) and not dates[0].equals(dates[1]):
            raise ValueError("x and u: expected data frames with the same dates; reindex one of them to the other")

    def _logs(
        self,
        x: Runs,
        t: Any,
        u: Any,
        feature_names: Sequence[str] | None,
        least: int = 1,
        width: int | None = None,
        is_new: bool = True,
    ) -> tuple[Any, list[str] | None, list[str] | None]:
        """Logs of runs, and the names of outputs and inputs if the runs are arrays."""
        if _is_own(x):
            if u is not None:
                raise TypeError("u: expected None, since the logs have the commands; name them with inputs=")
            return x, None, None
        name = type(self).__name__
        given, several = _items(x)
        of_u = _matched("u", u, len(given), several and not callable(u))
        if is_new:
            self._columns = (_frame_names(given[0]), _frame_names(of_u[0]))
        for run, commands_of_run in zip(given, of_u):
            self._check_columns(run, commands_of_run)
        items = [_table("x", item, width, name, least) for item in given]
        times = [
            _time((self.dt if _dates(run) is None else _dates(run)) if time is None else time, len(item))
            for run, item, time in zip(
                given, items, _matched("t", t, len(items), several and isinstance(t, (list, tuple)))
            )
        ]
        commands = [
            _table("u", _called(item, time), None, name)
            for item, time in zip(of_u, times)
        ]
        q, m = items[0].shape[1], commands[0].shape[1]
        if feature_names is None:
            of_x, of_commands = self._columns
            names = [*(of_x or [f"x{i}" for i in range(q)]), *(of_commands or [f"u{i}" for i in range(m)])]
        elif len(feature_names) == q + m:
            names = list(feature_names)
        else:
            raise ValueError(
                f"feature_names: expected {q + m} names for {q} outputs and {m} inputs, got {len(feature_names)}"
            )
        clock = next((name for name in _TIMES if name not in names), None)
        if clock is None:
            raise ValueError("feature_names: t and T are the names of times; rename one of them")
        logs = []
        for i, (outputs, inputs, time) in enumerate(zip(items, commands, times)):
            if (outputs.shape[1], inputs.shape[1]) != (q, m):
                raise ValueError(
                    f"x and u: expected {q} outputs and {m} inputs as in run 0, got {outputs.shape[1]} and "
                    f"{inputs.shape[1]} in run {i}"
                )
            if m and len(inputs) != len(outputs):
                raise ValueError(
                    f"u: expected {len(outputs)} samples as in x, got {len(inputs)} in run {i}; rows are samples: is an "
                    "array transposed?"
                )
            columns = {clock: time, **dict(zip(names, [*outputs.T, *inputs.T]))}
            logs.append(Log(columns, units={clock: "s"}, name=f"run {i}"))
        if is_new:
            factors = np.array(logs[0].factors[1:])
            self._factors = (factors[:q], factors[q:])
            if self._columns[0] is not None:
                self.feature_names_in_ = np.array(self._columns[0], dtype=object)
        return logs, names[:q], names[q:]


#: Arguments of PySINDy, and what takes their place.
_REMEDIES = {
    "x_dot": "derivatives are found from the samples: give the samples and their times",
    "ensemble": "the parameter members= is the number of members",
    "n_models": "the parameter members= is the number of members",
    "library_ensemble": "terms are chosen by predictions on runs that are left out",
    "multiple_trajectories": "a list of runs needs no flag",
    "sample_weight": "rows have the same weight; leave out runs, or parts of logs",
    "unbias": "coefficients are always found without the threshold",
    "quiet": "use warnings.catch_warnings",
}


#: Names of the column of times, the first of which is found before all others; one that no feature has is taken.
_TIMES = ("t", "T")


def _is_own(x: Any) -> bool:
    """Whether runs are logs, runs, paths or data frames, not arrays."""
    item = x[0] if isinstance(x, (list, tuple)) and x else x
    return isinstance(item, (Log, Run, str, os.PathLike))


def _items(x: Any) -> tuple[list[Any], bool]:
    """The runs, and whether they are a list of runs. A list of numbers or of rows is one run."""
    if isinstance(x, (list, tuple)) and x and np.ndim(x[0]) == 2 or isinstance(x, np.ndarray) and x.ndim == 3:
        return list(x), True
    return [x], False


def _called(u: Any, times: NDArray[Any]) -> Any:
    """Commands; those of a function are rows, whatever the shape of its values."""
    return [np.ravel(u(time)) for time in times] if callable(u) else u


def _scaled(values: NDArray[np.float64], factors: Any) -> NDArray[np.float64]:
    """Commands in SI units; none have no columns."""
    return values if factors is None or not values.size else factors * values


def _frame_names(given: Any) -> list[str] | None:
    """The names of the columns of a data frame, where they are texts, as scikit-learn takes them."""
    columns = getattr(given, "columns", None)
    return None if columns is None or not all(isinstance(name, str) for name in columns) else list(columns)


def _matched(argument: str, given: Any, runs: int, several: bool) -> list[Any]:
    """One value for each run."""
    if given is None or not several:
        return [given] * runs
    if isinstance(given, np.ndarray) and given.ndim == 3:
        given = list(given)
    if not isinstance(given, (list, tuple)) or len(given) != runs:
        raise ValueError(f"{argument}: expected a list with an item for each of {runs} runs, got {type(given).__name__}")
    return list(given)


def _table(argument: str, given: Any, columns: int | None, name: str, least: int = 1) -> NDArray[np.float64]:
    """An array (samples, columns) without infinite values; NaN is missing. A run without commands has no columns."""
    if given is None:
        if columns:
            raise ValueError(f"{argument}: expected {columns} columns of commands, got None")
        return np.empty((0, 0))
    if isinstance(given, np.ma.MaskedArray):
        given = np.ma.filled(given.astype(np.float64), np.nan)
    if argument == "u" and np.ndim(given) == 1:
        # One command, or a function of time that gives numbers.
        given = np.reshape(given, (-1, 1))
    values: NDArray[np.float64] = check_array(
        given,
        dtype=np.float64,
        ensure_all_finite="allow-nan",
        ensure_min_samples=least,
        input_name=argument,
        estimator=name,
    )
    if columns is not None and values.shape[1] != columns:
        raise ValueError(f"X has {values.shape[1]} features, but {name} is expecting {columns} features as input: {argument}")
    return values


def _is_time(y: Any) -> bool:
    """Whether the second argument of `fit` is a sample time or has the times of the samples."""
    if isinstance(y, (list, tuple)) and y and all(np.ndim(item) == 1 for item in y):
        return all(_is_time(item) for item in y)
    times = _seconds(y)
    return times.dtype.kind in "iuf" and (times.ndim == 0 or times.ndim == 1 and bool((np.diff(times) > 0).all()))


def _seconds(given: Any) -> NDArray[Any]:
    """Dates as seconds after the first one; anything else as it is."""
    times = np.asarray(given)
    if times.dtype == object and times.ndim == 1 and times.size and hasattr(times[0], "utcoffset"):
        # Dates of Python or pandas, also with a time zone.
        dates = [(date - date.utcoffset()).replace(tzinfo=None) if date.tzinfo else date for date in times]
        times = np.array(dates, dtype="datetime64[ns]")
    if times.dtype.kind == "m" and times.ndim == 0:
        times = times / np.timedelta64(1, "s")
    elif times.dtype.kind in "mM" and times.size:
        times = (times - times.flat[0]) / np.timedelta64(1, "s")
    return times


def _dates(run: Any) -> Any:
    """The dates of a data frame."""
    index = getattr(run, "index", None)
    return index if getattr(getattr(index, "dtype", None), "kind", "") in ("m", "M") else None


def _check_clock(run: Any, dt: float) -> None:
    """Refuses data frames whose dates are not those of consecutive samples of a model."""
    dates = _dates(run)
    steps = np.empty(0) if dates is None else np.diff(_seconds(dates))
    if not np.allclose(steps, dt, rtol=0.5, atol=0.0) or steps.size and not np.isclose(np.median(steps), dt, rtol=1e-3, atol=0.0):
        raise ValueError(
            f"x: expected dates with the sample time of the model, {dt:g} s, got steps of {np.min(steps):g} to "
            f"{np.max(steps):g} s; give the parts beside a gap as runs of their own"
        )


def _threads(n_jobs: int | None) -> int | None:
    """Threads for the `n_jobs` of scikit-learn: None and -1 are all cores, -2 all but one."""
    if n_jobs is None or n_jobs == -1:
        return None
    if n_jobs == 0:
        raise ValueError("n_jobs: expected a number of threads, or -1 for all cores, got 0")
    return n_jobs if n_jobs > 0 else max(1, (os.cpu_count() or 1) + 1 + n_jobs)


def _time(given: Any, samples: int) -> NDArray[np.float64]:
    if given is None:
        raise ValueError("t: expected the sample time or the times of the samples [s], got None; or set the parameter dt")
    times = _seconds(given)
    if times.dtype.kind not in "iuf":
        raise TypeError(f"t: expected numbers [s], got {type(given).__name__}")
    times = times.astype(np.float64)
    if times.ndim == 0:
        if not (np.isfinite(times) and times > 0.0):
            raise ValueError(f"t: expected a positive sample time, got {given!r}")
        return times * np.arange(samples)
    if times.shape != (samples,):
        raise ValueError(f"t: expected shape ({samples},), got {times.shape}")
    return times


def _next_outputs(model: Model, outputs: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    session = model.session()
    commands = inputs if inputs.shape[1] else np.empty((len(outputs), 0))
    predicted = np.empty_like(outputs)
    first = min(model.warm_up - 1, len(outputs))
    if first > 0:
        warn_of_warm_up(model, first)
    for k, (measured, command) in enumerate(zip(outputs, commands)):
        session.observe(measured)
        session.advance(command)
        predicted[k] = session.output
    predicted[:max(first, 0)] = np.nan
    return predicted


def _derivatives(model: Model, outputs: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = model.derivative(outputs, inputs if inputs.shape[1] else None)
    first = min(model.warm_up - 1, len(found))
    if first > 0:
        warn_of_warm_up(model, first)
        found[:first] = np.nan
    return found


class SINDy(_Dynamics):
    __doc__ = f"""Sparse identification of nonlinear dynamics: ``dy/dt = Xi theta(y, c)``.

    Data of no vessel with white noise have the best subset of polynomials that leaves nothing but this noise, if there is
    one. Otherwise, library, regression, thresholds, lags of actuators and a change of mode are selected by the errors of
    predictions on runs that are left out, where they are not given.

    Parameters
    ----------
    library : str, optional
        Library by name: ``"marine"``, ``"degree 2 + x|x|"``.
    degree : int, optional
        Degree of the polynomial library; default: up to 3 for data of no vessel, where no output is called u, v or r or
        has a unit of velocity.
    signed_squares : bool, optional
        Whether the library has signed squares ``x |x|``.
    constant : bool, optional
        Whether the library has the constant 1.
    terms, constraints : list of str, optional
        Terms, ``"u |u|"``: beside the library of `library`, `degree`, `signed_squares` or `constant`, and else the only
        ones; constraints on coefficients, ``"u: u |u| <= 0"``.
    dissipative : bool, optional
        Whether the coefficients of ``y`` and ``y |y|`` in the equation of each output ``y`` are not positive.
    threshold : float, optional
        Threshold of sequentially thresholded least squares, in standard deviations of the output per second. It is a
        bound on contributions; that of PySINDy is one on coefficients. Terms are selected with the ridge penalty, and
        their coefficients are then found without it: a contribution may be smaller.
    ridge : float, optional
        Ridge penalty for each row, on columns of unit RMS.
    huber : float, optional
        Threshold of the Huber loss in standard deviations; default: least squares.
    window_s, past_s : float, optional
        Window of the regression, and delay of past values [s].
    central_differences : bool, optional
        Central differences instead of the weak form.
    lag, gate : str or dict, optional
        ``"auto"``, ``"none"``, or time constants [s] by input, ``{{"n": 1.5}}``; for a gate
        ``{{"output": "u", "centre": 2.5, "slope": 12}}``. Default: ``"auto"``, and no gate for data of no vessel.
    refine : bool, optional
        Refinement on predictions over the horizon.
    members : int, optional
        Members of the ensemble for the uncertainty of the coefficients.
    for_control : bool, optional
        Whether the equations are affine in one function of each command.
{_COMMON_TEXT}"""

    _method = "sindy"

    def __init__(
        self,
        *,
        library: str | None = None,
        degree: int | None = None,
        signed_squares: bool | None = None,
        constant: bool | None = None,
        terms: Sequence[str] | None = None,
        constraints: Sequence[str] | None = None,
        dissipative: bool | None = None,
        threshold: float | None = None,
        ridge: float | None = None,
        huber: float | None = None,
        window_s: float | None = None,
        past_s: float | None = None,
        central_differences: bool | None = None,
        lag: Any = None,
        gate: Any = None,
        refine: bool | None = None,
        members: int | None = None,
        for_control: bool | None = None,
        dt: float | None = None,
        horizon: int | str | None = None,
        outputs: Channels | None = None,
        inputs: Channels | None = None,
        log: Mapping[str, Any] | None = None,
        random_state: int = 0,
        n_jobs: int | None = None,
    ) -> None:
        self.library = library
        self.degree = degree
        self.signed_squares = signed_squares
        self.constant = constant
        self.terms = terms
        self.constraints = constraints
        self.dissipative = dissipative
        self.threshold = threshold
        self.ridge = ridge
        self.huber = huber
        self.window_s = window_s
        self.past_s = past_s
        self.central_differences = central_differences
        self.lag = lag
        self.gate = gate
        self.refine = refine
        self.members = members
        self.for_control = for_control
        self.dt = dt
        self.horizon = horizon
        self.outputs = outputs
        self.inputs = inputs
        self.log = log
        self.random_state = random_state
        self.n_jobs = n_jobs

    def predict(self, x: Runs, u: Any = None) -> Any:
        """The derivatives ``dy/dt`` at the samples, as PySINDy's `predict`.

        Parameters
        ----------
        x : as in `fit`
        u : array_like (samples, inputs) or list of these, optional

        Returns
        -------
        ndarray (samples, outputs), or list of these
            Rows before sample `min_context` are NaN, in which the lags of the actuators settle, and a warning says so.
        """
        return self._each(x, u, _derivatives)

    def get_feature_names(self) -> list[str]:
        """Names of the terms with a coefficient other than zero in any equation."""
        return list(dict.fromkeys(term for _, term, *_ in self._found().coefficients()))

    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients, shape (outputs, terms), in the order of `get_feature_names`."""
        names = self.get_feature_names()
        model = self._found()
        outputs = model.output_names
        table = np.zeros((len(outputs), len(names)))
        for output, term, value, *_ in model.coefficients():
            table[outputs.index(output), names.index(term)] = value
        return table

    @property
    def complexity(self) -> int:
        """Number of coefficients other than zero."""
        return int(np.count_nonzero(self.coefficients()))

    def equations(self, precision: int | None = None) -> list[str]:
        """The equations as text.

        Parameters
        ----------
        precision : int, optional
            Decimals of the coefficients, with the terms as in `get_feature_names`. Default: four significant digits,
            with the terms of a change of mode in brackets.

        Returns
        -------
        list of str
        """
        model = self._found()
        whole = model.equations()
        if precision is None:
            return whole
        texts = []
        for output in model.output_names:
            of = [(value, term) for name, term, value, *_ in model.coefficients() if name == output]
            sides = " + ".join(f"{value:.{precision}f} {'' if term == '1' else term}".rstrip() for value, term in of)
            texts.append(f"d{output}/dt = " + (sides.replace("+ -", "- ") or "0"))
        # Equations of the lags; the gates are in the terms.
        return texts + [text for text in whole[len(texts):] if text.startswith("d ")]

    def print(self, precision: int | None = None) -> None:
        """Print the equations.

        Parameters
        ----------
        precision : int, optional
            As in `equations`.
        """
        print("\n".join(self.equations(precision)))


class Committee(_Dynamics):
    __doc__ = f"""Difference equations combined by cross-validation; one run is left out at a time.

    Parameters
    ----------
{_COMMON_TEXT}"""

    _method = "committee"

    def __init__(
        self,
        *,
        dt: float | None = None,
        horizon: int | str | None = None,
        outputs: Channels | None = None,
        inputs: Channels | None = None,
        log: Mapping[str, Any] | None = None,
        random_state: int = 0,
        n_jobs: int | None = None,
    ) -> None:
        self.dt = dt
        self.horizon = horizon
        self.outputs = outputs
        self.inputs = inputs
        self.log = log
        self.random_state = random_state
        self.n_jobs = n_jobs


class _Network(_Dynamics):
    __doc__ = f"""A network. Options that are None have the defaults of the kind of network.

    Parameters
    ----------
    hidden, layers, projection : int, optional
        Cells of each layer, number of layers, length of the projection of an LSTM.
    read_out, feedback : bool, optional
        Whether a linear output layer follows the cell, and whether the outputs are fed back.
    base : str, optional
        Base model: ``"nothing"`` or ``"hold"`` (increments).
    wash_out_s, history_s, window_s : float, optional
        Wash-out at the start of a window, history of a direct predictor, compared part of a window [s].
    epochs, batch, restarts, patience : int, optional
        Largest number of passes, windows of a step, trainings from different weights, and epochs without a lower
        validation error after which a training ends.
    learning_rate, weight_decay, clip : float, optional
        Peak step size, decoupled weight decay, largest norm of the gradient.
    refit, ensemble : bool, optional
        Whether the network is refitted on all runs; whether the restarts of a direct predictor form an ensemble.
    precision : str, optional
        Precision of the training, ``"single"`` or ``"double"``.
{_COMMON_TEXT}"""

    def __init__(
        self,
        *,
        hidden: int | None = None,
        layers: int | None = None,
        projection: int | None = None,
        read_out: bool | None = None,
        feedback: bool | None = None,
        base: str | None = None,
        wash_out_s: float | None = None,
        history_s: float | None = None,
        window_s: float | None = None,
        epochs: int | None = None,
        batch: int | None = None,
        restarts: int | None = None,
        patience: int | None = None,
        learning_rate: float | None = None,
        weight_decay: float | None = None,
        clip: float | None = None,
        refit: bool | None = None,
        ensemble: bool | None = None,
        precision: str | None = None,
        dt: float | None = None,
        horizon: int | str | None = None,
        outputs: Channels | None = None,
        inputs: Channels | None = None,
        log: Mapping[str, Any] | None = None,
        random_state: int = 0,
        n_jobs: int | None = None,
    ) -> None:
        self.hidden = hidden
        self.layers = layers
        self.projection = projection
        self.read_out = read_out
        self.feedback = feedback
        self.base = base
        self.wash_out_s = wash_out_s
        self.history_s = history_s
        self.window_s = window_s
        self.epochs = epochs
        self.batch = batch
        self.restarts = restarts
        self.patience = patience
        self.learning_rate = learning_rate
        self.weight_decay = weight_decay
        self.clip = clip
        self.refit = refit
        self.ensemble = ensemble
        self.precision = precision
        self.dt = dt
        self.horizon = horizon
        self.outputs = outputs
        self.inputs = inputs
        self.log = log
        self.random_state = random_state
        self.n_jobs = n_jobs


class GRU(_Network):
    __doc__ = f"Gated recurrent unit. {_Network.__doc__}"
    _method = "gru"


class LSTM(_Network):
    __doc__ = f"Long short-term memory. {_Network.__doc__}"
    _method = "lstm"


class DirectPredictor(_Network):
    __doc__ = f"A perceptron from recent samples and the next commands to the outputs at all horizons. {_Network.__doc__}"
    _method = "direct"
