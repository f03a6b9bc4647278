from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _hydroid
from ._hydroid import Log, Model, Run
from ._options import Bar, Channels, log_section


def read_log(path: str | os.PathLike[str], config: str | os.PathLike[str] | None = None) -> Log:
    """Read a log: CSV, Parquet, XLSX, or a recording of ArduPilot, PX4, ROS or NMEA 0183, or a folder of topics.

    Parameters
    ----------
    path : path
        The file or folder.
    config : path, optional
        A file ``hydroid.toml``, as ``hydroid inspect --write-config`` proposes it. Its section ``[log]`` selects columns of
        a recording, and ``[log.sensors]`` the sensors from which `u`, `v` and `r` are computed. The log then has the
        channels of the selection in SI units.

    Returns
    -------
    Log

    Raises
    ------
    FileNotFoundError, OSError
        If the file cannot be read.
    ValueError
        If it is not a log; the message names line, column and remedy.

    Warns
    -----
    LogWarning
        If a part of the file could not be read, or a sensor is not observable.

    See Also
    --------
    read_logs : Recordings of one vessel, which are better read together.
    """
    return _hydroid.read_logs([path], config)[0]


def read_logs(
    paths: Sequence[str | os.PathLike[str]],
    config: str | os.PathLike[str] | None = None,
    *,
    progress: bool | Callable[[float], object] = False,
) -> list[Log]:
    """Read the logs of one vessel together.

    With sensors, the delay of the receiver, the misalignment of the compass and the statistics of the sensors are the same in
    all recordings. They are estimated from all of them, and are more certain than those of a recording that is read alone.

    Parameters
    ----------
    paths : list of path
        Files or folders of any format that `read_log` reads.
    config : path, optional
        As in `read_log`.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.

    Returns
    -------
    list of Log
        In the order of the paths.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As in `read_log`.

    Warns
    -----
    LogWarning
        As in `read_log`.

    See Also
    --------
    identify : Reads recordings in the same way, and its models read further recordings with the same sensors.
    """
    paths = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    with Bar(progress, "reading") as bar:
        return _hydroid.read_logs(paths, config, bar.callback)


def prepare(
    logs: Any,
    *,
    outputs: Channels | None = None,
    inputs: Channels | None = None,
    heading: str | None = None,
    wind: str | None = None,
    time: str | None = None,
    **options: Any,
) -> list[Run]:
    """Convert logs to runs with a common clock, in SI units.

    Parameters
    ----------
    logs : Log, path, data frame, mapping, or list of these
    outputs, inputs : str, list of str, or mapping
        Channels: ``"u,v,r"``, ``["u", "v"]``, or ``{"u": "speed [kn]"}`` from names to columns. By default they are
        found by their names.
    heading, time : str, optional
        Columns of heading and time.
    wind : str, optional
        Columns of speed and direction of the wind, separated by a comma.
    **options
        Further keys of the section ``[log]`` of ``hydroid.toml``: ``dt``, ``max_gap``, ``command_timing``,
        ``input_delay``, ``keep_towed``, ``between``, ``exclude``, ``where``, ``sensors``. Recordings are read with these
        options, all paths together.

    Returns
    -------
    list of Run
        In the order of the logs; a log with gaps gives several runs.
    """
    section = log_section(outputs, inputs, heading, wind, time, **options)
    return _hydroid.prepare(logs, section)


def restored(columns: dict[str, Any], name: str) -> Log:
    """A log from a pickle."""
    return Log(columns, name=name)


def samples(model: Model, horizon: int | str) -> int:
    """A horizon in samples of a model."""
    if isinstance(horizon, str):
        try:
            return max(round(float(horizon.removesuffix("s")) / model.dt), 1)
        except ValueError:
            raise ValueError(f"horizon: expected samples (100) or seconds ('10s'), got {horizon!r}") from None
    return horizon


class Rollouts(NamedTuple):
    """Predictions from origins along a run."""

    run: Run
    #: Samples of the origins, shape (origins,).
    origins: NDArray[np.intp]
    #: Predicted outputs after each origin, shape (origins, horizon, outputs).
    outputs: NDArray[np.float64]


def rollouts(model: Model, logs: Any, horizon: int | str, *, stride: int = 1, **options: Any) -> list[Rollouts]:
    """Predict from origins along runs, under the commands of the runs.

    Parameters
    ----------
    model : Model
    logs : Log, path, data frame, mapping, Run, or list of these
        Logs are read as those of the training of the model.
    horizon : int or str
        Samples, or seconds as ``"5s"``.
    stride : int
        Samples between two origins.
    **options
        Options of `prepare` that replace those of the model.

    Returns
    -------
    list of Rollouts
        One for each run.
    """
    section = log_section(**options) if options else None
    rolled = model.rollouts(logs, samples(model, horizon), stride, section)
    return [Rollouts(run, origins.astype(np.intp), outputs) for run, origins, outputs in rolled]
