"""Logs and models as HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from ._hydroid import Log, Model


def table(head: Iterable[str], rows: Iterable[Iterable[str]], caption: str = "") -> str:
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption><tr>{cells}</tr>{body}</table>"


def of_log(log: Log) -> str:
    rows = []
    for name in log.columns:
        values = log[name]
        known = values[np.isfinite(values)]
        numbers = [known.min(), known.max()] if known.size else []
        low, high = [f"{x:.4g}" for x in numbers] or ["", ""]
        rows.append([name, log.units[name] or "", low, high, str(values.size - known.size)])
    return table(["column", "unit", "lowest", "highest", "missing"], rows, f"{log.name}: {len(log)} rows")


def of_model(model: Model) -> str:
    channels = table(
        ["channel", "", "unit", "lowest", "highest"],
        (
            [name, kind, model.units[name], *(f"{x:.4g}" for x in model.ranges[name])]
            for kind, names in (("output", model.output_names), ("input", model.input_names))
            for name in names
        ),
        f"{model.name} ({model.kind}): {model.size} weights, dt = {model.dt:g} s",
    )
    try:
        latex = model.latex()
    except NotImplementedError:
        return channels
    return f"{channels}<div>{escape(latex, quote=False)}</div>"
