from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from . import _hydroid
from ._evaluate import Evaluation
from ._hydroid import Model
from ._options import Bar, Channels, by_name, log_section, tables, takes


class Judgement(NamedTuple):
    """The errors of a model on runs that took no part in its fit.

    `validation` are those of the cross-validation or of the validation runs, `test` those of the test runs.
    """

    validation: Evaluation
    test: Evaluation | None

    @property
    def judged(self) -> Evaluation:
        """Errors on the test runs, else those of the cross-validation."""
        return self.validation if self.test is None else self.test


class Identification:
    """Result of `identify`.

    Attributes
    ----------
    models : dict of str to Model
        By the names of the methods. A method that failed is missing; a warning states the reason.
    best : Model or None
        The best model on runs that were left out; None if every model diverged, or there are too few data.
    not_enough_data : dict or None
        What is missing for a judgement: ``windows``, ``needed``, ``horizon_s``, ``missing_s``, ``message``.
    judgement : dict of str to Judgement
    verdicts : list of dict
        Grade of each output.
    warnings : list of dict
    summary : dict
        All of it, as in ``identify.json``.
    """

    def __init__(self, inner: _hydroid.Identification) -> None:
        self._inner: _hydroid.Identification | None = inner
        self._fill(inner.summary(), inner.models())

    def _fill(self, summary: dict[str, Any], models: list[Model]) -> None:
        self.summary = summary
        self.models: dict[str, Model] = {model.name: model for model in models}
        self.best: Model | None = self.models.get(summary.get("best", ""))
        self.not_enough_data: dict[str, Any] | None = summary.get("not_enough_data")
        self.judgement = {
            model["name"]: Judgement(
                Evaluation(model["validation"]), None if model["test"] is None else Evaluation(model["test"])
            )
            for model in summary["models"]
        }
        self.verdicts: list[dict[str, Any]] = summary["verdicts"]
        self.warnings: list[dict[str, Any]] = summary["warnings"]

    def __getstate__(self) -> dict[str, Any]:
        # The compiled result has the samples of the runs, of which the report is what remains.
        return {"summary": self.summary, "models": list(self.models.values()), "page": self.report()}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self._inner = None
        self._page: str = saved["page"]
        self._fill(saved["summary"], saved["models"])

    def to_pandas(self) -> Any:
        """Errors of all models as a pandas data frame: one row for each model, horizon and output."""
        import pandas

        return pandas.DataFrame([row for of in self.judgement.values() for row in of.judged.records()])

    def report(self, title: str | None = None) -> str:
        """The report as an HTML page.

        Parameters
        ----------
        title : str, optional
            A result from a pickle has the default title.
        """
        if self._inner is None:
            if title is not None:
                raise ValueError("title: expected None, since a result from a pickle has its report")
            return self._page
        return self._inner.report(title, " ".join(sys.argv))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write models, ``report.html`` and ``identify.json`` into a folder, as ``hydroid identify -o`` does."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        summary = json.loads(json.dumps(self.summary))
        for entry in summary["models"]:
            suffix = ".toml" if entry["kind"] == "vessel" else ".safetensors"
            file = folder / f"{entry['name']}{suffix}"
            self.models[entry["name"]].save(file)
            entry["file"] = str(file)
        _write(folder / "report.html", self.report())
        _write(folder / "identify.json", json.dumps(summary, indent=2) + "\n")

    def __repr__(self) -> str:
        best = "none" if self.best is None else self.best.name
        grades = ", ".join(f"{verdict['channel']}: {verdict['grade']}" for verdict in self.verdicts)
        models = ", ".join(f"{name} (mean NRMSE {of.judged.score:.3f})" for name, of in self.judgement.items())
        missing = "" if self.not_enough_data is None else f"; {self.not_enough_data['message']}"
        return f"Identification(models {models}; best {best}; its grades {grades}{missing})"

    def _repr_html_(self) -> str:
        from html import escape

        tables = "".join(of.judged._repr_html_() for of in self.judgement.values())
        return f"<p>{escape(repr(self))}</p>{tables}"


def _write(path: Path, text: str) -> None:
    """Write a file completely or not at all."""
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


@takes("identify")
def identify(
    logs: Any = (),
    *,
    validate: Any = (),
    test: Any = (),
    outputs: Channels | None = None,
    inputs: Channels | None = None,
    heading: str | None = None,
    wind: str | None = None,
    time: str | None = None,
    config: str | os.PathLike[str] | None = None,
    vessel: str | os.PathLike[str] | None = None,
    ranges: Mapping[str, tuple[float, float] | str] | str | None = None,
    log: Mapping[str, Any] | None = None,
    sections: Mapping[str, Mapping[str, Any]] | None = None,
    threads: int | None = None,
    progress: bool | Callable[[float], object] = False,
    **options: Any,
) -> Identification:
    """Identify models of a vessel from its logs.

    The same logs, options and seed give the same model files as ``hydroid identify``. All paths are read together: with
    ``[log.sensors]``, recordings share the delay of the receiver and the misalignment of the compass. A model contains the
    options of reading, and reads the path of a further recording in the same way.

    Parameters
    ----------
    logs : Log, path, data frame, mapping, or list of these
        Logs to learn from. Without `validate`, each run is left out once by methods that can be cross-validated.
        Default: those of the section ``[split]`` of `config`, as for `validate` and `test`.
    validate, test : Log, path, data frame, mapping, or list of these
        Logs that choose models, and logs that judge them.
    outputs, inputs, heading, wind, time
        Columns; see `prepare`.
    config : path, optional
        A file ``hydroid.toml``. Arguments take precedence over it.
    vessel : path, optional
        Vessel file whose marked numbers are estimated as well.
    ranges : mapping, optional
        Design range of channels: (low, high) in SI units, or ``"0:12 [kn]"``; all together ``"u=0:6,r=-20:20 [deg/s]"``.
    log : mapping, optional
        Further keys of ``[log]``: ``dt``, ``max_gap``, ``command_timing``, ``input_delay``, ``keep_towed``,
        ``between``, ``exclude``, ``where``, ``sensors``.
    sections : mapping, optional
        Sections of ``hydroid.toml``: ``{"sindy": {"degree": 3}, "network": {"epochs": 100}}``.
    threads : int, optional
        Default: all cores. The result does not depend on it.
    progress : bool or callable
        A bar of tqdm, or a function of the completed fraction.
    **options

    Returns
    -------
    Identification
    """
    given: dict[str, Any] = tables("sections", sections)
    given["log"] = {**given.get("log", {}), **log_section(outputs, inputs, heading, wind, time, **(log or {}))}
    given["identify"] = {**given.get("identify", {}), **options}
    if ranges is not None:
        given["ranges"] = by_name("ranges", ranges)
    with Bar(progress, "identifying") as bar:
        inner = _hydroid.identify(
            logs, validate, test, given, config, vessel, threads, bar.callback
        )
    return Identification(inner)
