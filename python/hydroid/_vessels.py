from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _hydroid
from ._hydroid import Log, Model
from ._options import Bar, log_section, takes

Array = NDArray[np.float64]

#: A model, the name of a built-in vessel, or the path of a vessel file or of a model file.
Plant = Union[Model, str, "os.PathLike[str]"]

#: Velocities of tracks over ground [m/s, m/s, rad/s].
MOTION = ("u", "v", "r")


def vessels() -> list[str]:
    """Names of the built-in vessels."""
    return _hydroid.vessels()


def vessel_toml(vessel: Plant) -> str:
    """The text of the file of a vessel, a template for a file of one's own.

    Parameters
    ----------
    vessel : str, path or Model
        A built-in vessel (see `vessels`), a vessel file, or the model of a vessel.

    Returns
    -------
    str
        TOML, as ``hydroid simulate VESSEL --print-vessel`` prints it. ``Model.from_bytes(text.encode())`` reads it.
    """
    return _hydroid.vessel_toml(vessel)


@takes("simulate")
def simulate(
    plant: Plant,
    excitation: Union[str, "os.PathLike[str]", Log, Mapping[str, Any]] = "mixed",
    *,
    figure: str | os.PathLike[str] | None = None,
    name: str | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> Log:
    """Simulate a log of a vessel or of an identified model.

    The same plant, options and seed give the numbers of ``hydroid simulate``.

    Parameters
    ----------
    plant : str, path or Model
        A built-in vessel (see `vessels`), a vessel file (``.toml``), a model file (``.safetensors``), or a model.
    excitation : str, path, Log, data frame or mapping
        ``"mixed"`` (random steps, ramps, chirps and PRBS). For a vessel with one propeller and one rudder also
        ``"low-speed"``, ``"lawn-mower"`` and ``"circle"``. A log, or the path of one, has the time and the commands, each
        held until the next. If a log has the outputs of an identified model, the simulation starts with the measured
        motion.
    **options
    figure : path, optional
        File of a figure (``.svg``) of the track of an identified model, those of its members, and the measured one.
    name : str, optional
        Name of the log; default vessel, excitation and seed.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.

    Returns
    -------
    Log
        Time, commands, pose, measured and true outputs; row k is the state before command k acts.
    """
    with Bar(progress, "simulating") as bar:
        return _hydroid.simulate(plant, excitation, options, name, figure, bar.callback)


class Track(NamedTuple):
    """The motion in a trial over ground. At ``t = 0`` the order is given."""

    #: Number and title of the trial; a pull-out has two tracks, a spiral has none.
    trial: int
    title: str
    #: Time since the order [s], shape (samples,).
    t: Array
    #: Position, north and east [m], shape (samples,).
    x: Array
    y: Array
    #: Heading [rad], clockwise from north and not wrapped, shape (samples,).
    psi: Array
    #: Velocities u, v [m/s] and r [rad/s] over ground, shape (samples, 3).
    outputs: Array
    #: Commands, each held until the next sample, shape (samples, inputs); None for a track in a log.
    commands: Array | None


class ComparedTrack(NamedTuple):
    """The tracks of a trial in a log and of its prediction."""

    measured: Track
    predicted: Track


class _Figures:
    """Figures of trials as records, tables and a report."""

    _inner: _hydroid.Trials | _hydroid.Comparisons
    document: dict[str, Any]
    figures: list[dict[str, Any]]
    _columns: tuple[str, ...]
    #: The column of the model.
    _predicted: str

    def __init__(self, inner: _hydroid.Trials | _hydroid.Comparisons) -> None:
        self._inner = inner
        self.document = inner.document()
        self.figures = inner.figures()

    def to_pandas(self) -> Any:
        """The figures as a pandas data frame."""
        import pandas

        return pandas.DataFrame(self.figures)

    def report(self) -> str:
        """The report as an HTML page."""
        return self._inner.report(" ".join(sys.argv))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the document, ``tracks.csv`` and ``report.html`` into a folder, as ``hydroid manoeuvre -o`` does."""
        self._inner.save(folder, " ".join(sys.argv))

    def _title(self, figure: dict[str, Any]) -> str:
        return str(figure["title"])

    def _rows(self) -> list[tuple[str, list[tuple[str, ...]]]]:
        """Titles of the trials with the rows of their figures."""
        trials: dict[int, tuple[str, list[tuple[str, ...]]]] = {}
        for figure in self.figures:
            title, rows = trials.setdefault(figure["trial"], (self._title(figure), []))
            cells = ["-" if figure[column] is None else f"{figure[column]:.4g}" for column in self._columns]
            if figure["not_valid"]:
                cells[self._columns.index(self._predicted)] = "not valid"
            rows.append((figure["figure"], *cells, figure["unit"]))
        return list(trials.values())

    def __repr__(self) -> str:
        lines = [f"{type(self).__name__} of {self.document['plant']}: {', '.join(self._columns)}"]
        for title, rows in self._rows():
            lines.append(title)
            for name, *cells, unit in rows:
                lines.append(f"  {name:<32}" + "".join(f"{cell:>12}" for cell in cells) + f"  {unit}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        from html import escape

        span = len(self._columns) + 2
        head = "".join(f"<th>{escape(cell)}</th>" for cell in ("", *self._columns, "unit"))
        body = ""
        for title, rows in self._rows():
            body += f'<tr><th colspan="{span}">{escape(title)}</th></tr>'
            body += "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        caption = f"{type(self).__name__} of {escape(str(self.document['plant']))}"
        return f"<table><caption>{caption}</caption><tr>{head}</tr>{body}</table>"


class Trials(_Figures):
    """Result of `manoeuvres`.

    Attributes
    ----------
    document : dict
        All results without the tracks, as in ``trials.json``.
    figures : list of dict
        One record for each figure: ``trial`` (number), ``title``, ``figure``, ``unit``, ``value`` (None if it was not
        reached), ``low`` and ``high`` (5 % and 95 % quantile over the members of the model, joined with the errors of
        trials that were left out of the fit), ``extrapolated``, ``not_valid`` (a reason, or None), and ``limit``, ``passed``
        and ``certain`` (whether the whole interval is on the same side; None if it holds no errors of trials, or the model
        extrapolates) of a criterion of the IMO.
    """

    _inner: _hydroid.Trials
    _columns = ("value", "low", "high", "limit")
    _predicted = "value"

    @property
    def input_names(self) -> list[str]:
        """Columns of the commands of tracks."""
        return self._inner.inputs()[0]

    @property
    def passed(self) -> bool:
        """Whether all trials are valid, and no criterion was missed."""
        return self._inner.passed()

    @cached_property
    def tracks(self) -> list[Track]:
        """The tracks, as in ``tracks.csv``."""
        return [Track(trial, title, *arrays) for trial, title, arrays in self._inner.tracks()]


class Comparisons(_Figures):
    """Result of `compare_manoeuvres`.

    Attributes
    ----------
    document : dict
        All results without the tracks, as in ``comparisons.json``.
    figures : list of dict
        One record for each figure: ``trial`` (number), ``run``, ``at_s`` (time in the run), ``title``, ``in_training``,
        ``figure``, ``unit``, ``measured``, ``predicted``, ``not_valid`` (why there is no prediction, or None),
        ``low`` and ``high`` of the prediction, as for simulated trials, ``measured_low`` and ``measured_high`` (90 % by
        the noise of positions and headings, or None), ``error`` (measured less predicted) and its ``uncertainty``.
    """

    _inner: _hydroid.Comparisons
    _columns = ("measured", "predicted", "low", "high")
    _predicted = "predicted"

    def _title(self, figure: dict[str, Any]) -> str:
        fitted = " (the model was fitted to a run of this name)" if figure["in_training"] else ""
        return f"{figure['run']}, {figure['at_s']:.1f} s: {figure['title']}{fitted}"

    @cached_property
    def tracks(self) -> list[ComparedTrack]:
        """Measured and predicted track of each trial, as in ``tracks.csv``."""
        return [
            ComparedTrack(Track(trial, title, *measured), Track(trial, title, *predicted))
            for trial, title, measured, predicted in self._inner.tracks()
        ]


@takes("manoeuvre")
def manoeuvres(
    model: Plant,
    trials: str | Sequence[str] | None = None,
    *,
    threads: int | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> Trials:
    """Run manoeuvring trials of a vessel or of an identified model.

    The trials are those of IMO resolution MSC.137(76) and of the ITTC procedure 7.5-04-02-01. Each begins on a straight
    course at a steady speed. The same model and options give the results of ``hydroid manoeuvre``.

    Parameters
    ----------
    model : Model, str or path
        A model, a built-in vessel (see `vessels`), a vessel file, or a model file.
    trials : str or list of str, optional
        ``turning-circle``, ``zigzag``, ``pull-out``, ``spiral``, ``acceleration``, ``stopping``; default all.
    **options
    threads : int, optional
        Default: all cores. The result does not depend on it.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.

    Returns
    -------
    Trials
    """
    with Bar(progress, "trials") as bar:
        return Trials(_hydroid.manoeuvres(model, {"trials": trials, **options}, threads, bar.callback))


def compare_manoeuvres(
    model: Plant,
    logs: Any,
    *,
    threads: int | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> Comparisons:
    """Compare the turns and zigzags in logs with the predictions of a model from their first samples.

    Parameters
    ----------
    model : Model, str or path
    logs : Log, path, data frame, mapping, Run, or list of these
        Logs are read as those of the training of the model.
    threads : int, optional
        Default: all cores. The result does not depend on it.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.
    **options
        Options of `prepare` that replace those of the model.

    Returns
    -------
    Comparisons
        The results of ``hydroid manoeuvre MODEL LOG``.
    """
    section = log_section(**options) if options else None
    with Bar(progress, "trials") as bar:
        return Comparisons(_hydroid.compare_manoeuvres(model, logs, section, threads, bar.callback))
