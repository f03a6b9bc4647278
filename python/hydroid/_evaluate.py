from __future__ import annotations

from collections.abc import Callable
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _hydroid
from ._hydroid import Model
from ._options import Bar, log_section

#: ``f(outputs, inputs, commands)``: measurements up to the origin, shape (k + 1, outputs); commands before it, shape
#: (k, inputs); commands from it on, shape (horizon, inputs). It returns the predicted outputs, shape (horizon, outputs).
Predictor = Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], Any]


def _text(value: float, form: str) -> str:
    """A number, or a dash where it is undefined."""
    return "-" if np.isnan(value) else format(value, form)


class Evaluation:
    """Errors of predictions by horizon and output, beside those of persistence on the same windows.

    Attributes
    ----------
    model : str
        Name of the predictor.
    dt : float
        Sample time [s].
    outputs, units : list of str
    horizons : ndarray of int, shape (horizons,)
        Samples.
    windows, diverged : int
        Number of origins, and of rollouts that diverged. Their limited predictions are part of all errors.
    mae, rmse, max, nrmse, r2 : ndarray, shape (horizons, outputs)
        In the units of the outputs, NaN where they are undefined; `nrmse` is the root mean square error over the standard deviation of the output.
    persistence : dict of str to ndarray
        `mae`, `rmse` and `nrmse` of persistence.
    document : dict
        All of it, as ``hydroid evaluate --json`` prints it.
    """

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document
        self.model: str = document["model"]
        self.dt: float = document["dt"]
        self.outputs: list[str] = document["channels"]
        self.units: list[str] = document["units"]
        self.horizons = np.array(document["horizons"], dtype=int)
        self.windows: int = document["windows"]
        self.diverged: int = document["diverged"]
        table = self._table
        self.mae, self.rmse, self.max = table(document["mae"]), table(document["rmse"]), table(document["max"])
        self.nrmse, self.r2 = table(document["nrmse"]), table(document["r2"])
        self.persistence = {name: table(rows) for name, rows in document["persistence"].items()}

    @staticmethod
    def _table(rows: list[list[float | None]]) -> NDArray[np.float64]:
        return np.array(rows, dtype=np.float64)

    @property
    def score(self) -> float:
        """Mean of the defined NRMSE over horizons and outputs; infinite after a divergence, or if none is defined."""
        defined = self.nrmse[np.isfinite(self.nrmse)]
        return float("inf") if self.diverged or not defined.size else float(np.mean(defined))

    def records(self) -> list[dict[str, Any]]:
        """One record for each horizon and output; None where an error is undefined."""

        def defined(value: np.float64) -> np.float64 | None:
            return None if np.isnan(value) else value

        rows = []
        for h, horizon in enumerate(self.horizons):
            for c, (output, unit) in enumerate(zip(self.outputs, self.units)):
                rows.append(
                    {
                        "model": self.model,
                        "output": output,
                        "unit": unit,
                        "horizon": int(horizon),
                        "horizon_s": float(horizon * self.dt),
                        "mae": defined(self.mae[h, c]),
                        "rmse": defined(self.rmse[h, c]),
                        "max": defined(self.max[h, c]),
                        "nrmse": defined(self.nrmse[h, c]),
                        "r2": defined(self.r2[h, c]),
                        "persistence_nrmse": defined(self.persistence["nrmse"][h, c]),
                    }
                )
        return rows

    def to_pandas(self) -> Any:
        """The records as a pandas data frame."""
        import pandas

        return pandas.DataFrame(self.records())

    def _rows(self) -> list[tuple[str, ...]]:
        last = len(self.horizons) - 1
        places = sorted({round(last * i / 4) for i in range(1, 5)}) if last >= 0 else []
        head = ("horizon", *(f"{name} [{unit}]" for name, unit in zip(self.outputs, self.units)))
        rows = [head]
        for h in places:
            persistence = self.persistence["nrmse"]
            cells = (
                f"{_text(self.rmse[h, c], '.4g')} (NRMSE {_text(self.nrmse[h, c], '.3f')}, "
                f"persistence {_text(persistence[h, c], '.3f')})"
                for c in range(len(self.outputs))
            )
            rows.append((f"{self.horizons[h] * self.dt:.4g} s", *cells))
        return rows

    def __repr__(self) -> str:
        lines = [f"Evaluation of {self.model}: {self.windows} windows, {self.diverged} diverged; RMSE"]
        lines += [f"  {horizon:>8}" + "".join(f"  {cell:>42}" for cell in cells) for horizon, *cells in self._rows()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        from html import escape

        rows = self._rows()
        head = "".join(f"<th>{escape(cell)}</th>" for cell in rows[0])
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows[1:])
        caption = f"{escape(self.model)}: RMSE over {self.windows} windows, {self.diverged} diverged"
        return f"<table><caption>{caption}</caption><tr>{head}</tr>{body}</table>"


def evaluate(
    predictor: Union[Model, Predictor],
    logs: Any,
    *,
    horizon: int | str = 100,
    stride: int = 1,
    warm_up: int = 1,
    origin: str = "measured",
    against: str = "measurement",
    name: str | None = None,
    threads: int | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> Evaluation:
    """Judge a model, or any function, by its predictions from origins along runs.

    From every origin past the warm-up, what was measured up to it and commanded before it is known, and the outputs are
    predicted under the commands of the run. Predictors with the same warm-up have the same origins; a model has one of
    its own (`Model.warm_up`), and the longer one counts.

    Parameters
    ----------
    predictor : Model, fitted estimator, or callable
        A callable has the arguments ``outputs`` (k + 1, outputs), ``inputs`` (k, inputs) and ``commands``
        (horizon, inputs), and returns the predictions (horizon, outputs). Missing measurements are NaN.
    logs : Log, path, data frame, mapping, Run, or list of these
    horizon : int or str
        Longest horizon: samples, or seconds as ``"10s"``.
    stride : int
        Samples between two origins.
    warm_up : int
        Least number of measurements before the first prediction.
    origin, against : str
        ``"true"`` and ``"truth"`` use the true outputs of a simulated log.
    name : str, optional
        Default: the name of the model or function.
    threads : int, optional
        Default: all cores. A function is called by one thread.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.
    **options
        Options of `prepare`; those of a model are the default.

    Returns
    -------
    Evaluation
    """
    if stride < 1:
        raise ValueError(f"stride: expected at least 1, got {stride}")
    section = log_section(**options) if options else None
    # A fitted estimator has its model.
    predictor = getattr(predictor, "model_", predictor)
    if isinstance(owner := getattr(predictor, "__self__", None), Model):
        # `Model.predict` as a function.
        warm_up = max(warm_up, owner.warm_up)
    with Bar(progress, "evaluating") as bar:
        document = _hydroid.evaluate(
            predictor, logs, horizon, stride, section, name, warm_up, origin, against, threads, bar.callback
        )
    return Evaluation(document)
