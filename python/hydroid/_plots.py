"""Plots. Each function draws into matplotlib axes and returns them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Union

import numpy as np

from ._evaluate import Evaluation
from ._hydroid import Model, Run
from ._identify import Identification
from ._logs import prepare, rollouts, samples
from ._vessels import Comparisons, Track, Trials

Axes = Any


def _pyplot() -> Any:
    try:
        import matplotlib.pyplot as pyplot
    except ImportError as error:
        raise ImportError("the plots need matplotlib: pip install matplotlib") from error
    return pyplot


def _columns(axes: Any, count: int, *, rows: bool) -> Any:
    """`count` axes, new ones if none are given."""
    if axes is None:
        shape = (count, 1) if rows else (1, count)
        size = (7.0, 2.2 * count) if rows else (3.4 * count, 3.0)
        _, axes = _pyplot().subplots(*shape, figsize=size, sharex=True, squeeze=False, layout="constrained")
    axes = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
    if len(axes) != count:
        raise ValueError(f"axes: expected {count} axes, got {len(axes)}")
    return axes


def _label(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit and unit != "1" else name


def plot_horizon(
    evaluations: Union[Evaluation, Identification, Sequence[Evaluation], Mapping[str, Evaluation]],
    *,
    metric: str = "rmse",
    persistence: bool = True,
    axes: Any = None,
) -> Axes:
    """Draw errors over the horizon, one panel for each output.

    Parameters
    ----------
    evaluations : Evaluation, Identification, list, or mapping from labels to evaluations
        Evaluations of the same outputs. An identification shows the judged errors of all its models.
    metric : str
        ``mae``, ``rmse``, ``max`` (in the units of the outputs), ``nrmse`` or ``r2``.
    persistence : bool
        Whether the errors of persistence are drawn, where the metric has them.
    axes : sequence of matplotlib axes, optional
        One for each output.

    Returns
    -------
    ndarray of matplotlib axes
    """
    if metric not in ("mae", "rmse", "max", "nrmse", "r2"):
        raise ValueError(f"metric: expected mae, rmse, max, nrmse or r2, got {metric!r}")
    if isinstance(evaluations, Evaluation):
        evaluations = [evaluations]
    elif isinstance(evaluations, Identification):
        evaluations = {name: of.judged for name, of in evaluations.judgement.items()}
    if isinstance(evaluations, Mapping):
        labelled = list(evaluations.items())
    else:
        labelled = [(evaluation.model, evaluation) for evaluation in evaluations]
    if not labelled:
        raise ValueError("evaluations: expected at least one, got none")
    first = labelled[0][1]
    for label, evaluation in labelled:
        if evaluation.outputs != first.outputs:
            raise ValueError(f"evaluations: expected the outputs {first.outputs}, got {evaluation.outputs} of {label}")
    axes = _columns(axes, len(first.outputs), rows=False)
    for c, (ax, output, unit) in enumerate(zip(axes, first.outputs, first.units)):
        for label, evaluation in labelled:
            ax.plot(evaluation.horizons * evaluation.dt, getattr(evaluation, metric)[:, c], label=label)
        if persistence and metric in first.persistence:
            times = first.horizons * first.dt
            ax.plot(times, first.persistence[metric][:, c], color="grey", linestyle="--", label="persistence")
        ax.set_xlabel("horizon [s]")
        name = {"nrmse": "NRMSE", "r2": "R²"}.get(metric)
        ax.set_ylabel(f"{name} of {output}" if name else _label(f"{metric.upper()} of {output}", unit))
        if metric != "r2":
            ax.set_ylim(bottom=0.0)
    axes[0].legend()
    return axes


def plot_rollouts(
    models: Union[Model, Sequence[Model], Mapping[str, Model]],
    logs: Any,
    horizon: int | str,
    *,
    stride: int | None = None,
    run: int = 0,
    axes: Any = None,
    **options: Any,
) -> Axes:
    """Draw predictions from origins along a run over the measurements, one panel for each output.

    Parameters
    ----------
    models : Model, list, or mapping from labels to models
    logs : Log, path, data frame, mapping, Run, or list of these
    horizon : int or str
        Samples, or seconds as ``"5s"``.
    stride : int, optional
        Samples between two origins; default: the horizon.
    run : int
        Index of the run, if the logs have several.
    axes : sequence of matplotlib axes, optional
        One for each output.
    **options
        Options of `hydroid.prepare`.

    Returns
    -------
    ndarray of matplotlib axes
    """
    if isinstance(models, Model):
        models = [models]
    labelled = list(models.items()) if isinstance(models, Mapping) else [
        (getattr(model, "name", ""), model) for model in models
    ]
    if not labelled:
        raise ValueError("models: expected at least one, got none")
    for label, model in labelled:
        if not isinstance(model, Model):
            raise TypeError(f"models: expected hydroid.Model objects, got {type(model).__name__}")
    axes = _columns(axes, len(labelled[0][1].output_names), rows=True)
    for i, (label, model) in enumerate(labelled):
        horizon = samples(model, horizon)
        found = rollouts(model, logs, horizon, stride=horizon if stride is None else stride, **options)
        if not 0 <= run < len(found):
            raise ValueError(f"run: expected an index below {len(found)}, the number of runs, got {run}")
        followed, origins, predicted = found[run]
        times = followed.t
        for c, (ax, output) in enumerate(zip(axes, model.output_names)):
            if i == 0:
                ax.plot(times, followed.outputs[:, c], color="black", linewidth=0.8, label="measured")
                ax.set_ylabel(_label(output, model.units[output]))
            # A gap separates two rollouts.
            starts = origins[:, None] + np.arange(horizon + 1)
            values = np.concatenate([followed.outputs[origins, c][:, None], predicted[:, :, c]], axis=1)
            gap = np.full((len(origins), 1), np.nan)
            ax.plot(
                np.concatenate([times[starts], gap], axis=1).ravel(),
                np.concatenate([values, gap], axis=1).ravel(),
                color=f"C{i}",
                linewidth=1.2,
                label=label,
            )
    axes[0].legend()
    axes[-1].set_xlabel("t [s]")
    return axes


def _pose(velocities: Any, dt: float, heading: Any = None) -> tuple[Any, Any]:
    """North and east [m] from body velocities (samples, 3) and the heading [rad], by the trapezoidal rule."""
    nu = np.nan_to_num(np.asarray(velocities, dtype=np.float64))
    if heading is None:
        rate = nu[:, 2]
        heading = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
    sin, cos = np.sin(heading), np.cos(heading)
    velocity = np.stack([nu[:, 0] * cos - nu[:, 1] * sin, nu[:, 0] * sin + nu[:, 1] * cos])
    moved = np.cumsum(0.5 * dt * (velocity[:, 1:] + velocity[:, :-1]), axis=1)
    north, east = np.concatenate([np.zeros((2, 1)), moved], axis=1)
    return north, east


def plot_track(tracks: Any, *, label: str | None = None, ax: Any = None, **options: Any) -> Axes:
    """Draw tracks seen from above, north up.

    Parameters
    ----------
    tracks : Run, Log, path, Track, mapping with ``x`` and ``y``, or list of these
        Runs need the outputs u, v and r; their positions are integrated from the start of the run, with the heading if
        the run has one. A track, or a mapping, has arrays of north ``x`` and east ``y`` [m].
    label : str, optional
    ax : matplotlib axes, optional
    **options
        Options of `hydroid.prepare`.

    Returns
    -------
    matplotlib axes
    """
    if ax is None:
        _, ax = _pyplot().subplots(figsize=(5.0, 5.0), layout="constrained")
    given = [tracks] if isinstance(tracks, Track) or not isinstance(tracks, (list, tuple)) else tracks
    for track in given:
        if isinstance(track, (Mapping, Track)):
            x, y = (track["x"], track["y"]) if isinstance(track, Mapping) else (track.x, track.y)
            ax.plot(y, x, label=label or getattr(track, "title", None))
            continue
        runs = [track] if isinstance(track, Run) else prepare(track, **options)
        for run in runs:
            missing = {"u", "v", "r"} - set(run.output_names)
            if missing:
                raise ValueError(f"tracks: expected runs with the outputs u, v, r, got {', '.join(run.output_names)}")
            order = [run.output_names.index(name) for name in "uvr"]
            north, east = _pose(run.outputs[:, order], run.dt, run.heading)
            ax.plot(east, north, label=label or run.name)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    return ax


def plot_manoeuvre(
    trials: Union[Trials, Comparisons, Mapping[str, Union[Trials, Comparisons]]],
    *,
    trial: int | Sequence[int] | None = None,
    axes: Any = None,
) -> Axes:
    """Draw trials: the tracks from above, and the heading over time.

    Parameters
    ----------
    trials : Trials, Comparisons, or mapping from labels to these
        Trials of a model, or those of logs, measured and predicted.
    trial : int or list of int, optional
        Numbers of the trials; default: all. A spiral has no track.
    axes : sequence of two matplotlib axes, optional

    Returns
    -------
    ndarray of two matplotlib axes
        The tracks, and the heading [deg] since the order.
    """
    labelled = trials if isinstance(trials, Mapping) else {"": trials}
    wanted = None if trial is None else {trial} if isinstance(trial, int) else set(trial)
    if axes is None:
        _, axes = _pyplot().subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    if len(axes) != 2:
        raise ValueError(f"axes: expected 2 axes, got {len(axes)}")
    above, heading = axes
    drawn = 0
    for i, (label, given) in enumerate(labelled.items()):
        tracks: list[tuple[str, Track]] = []
        for track in given.tracks:
            if isinstance(track, Track):
                tracks.append(("", track))
            else:
                tracks += [("measured", track.measured), ("predicted", track.predicted)]
        for kind, track in tracks:
            if wanted is not None and track.trial not in wanted:
                continue
            # One colour for a label, else for a track; what is predicted beside a measurement is dashed.
            colour = f"C{i if label else track.trial if kind else drawn}"
            line = {"color": colour, "linestyle": "--" if kind == "predicted" else "-"}
            name = ", ".join(part for part in (label, track.title, kind) if part)
            above.plot(track.y, track.x, label=name, **line)
            heading.plot(track.t, np.degrees(track.psi), **line)
            drawn += 1
    if not drawn:
        raise ValueError(f"trial: expected a trial with a track, got {trial!r}")
    above.set_aspect("equal", adjustable="datalim")
    above.set_xlabel("east [m]")
    above.set_ylabel("north [m]")
    above.legend(fontsize="small")
    heading.set_xlabel("t [s]")
    heading.set_ylabel("heading [deg]")
    return np.asarray(axes, dtype=object)
