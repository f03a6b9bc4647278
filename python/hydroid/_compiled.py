"""What Python adds to the compiled classes: documentation and signatures of the stub, which is their one source."""

from __future__ import annotations

import functools
import inspect
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import _hydroid
from ._hydroid import Model, Session


def _documented(compiled: Any, described: Any) -> Any:
    """A member of a compiled class with the documentation and the signature of the stub."""
    if isinstance(described, property):
        setter = compiled.__set__ if described.fset is not None else None
        return property(compiled.__get__, setter, doc=described.__doc__)
    if isinstance(described, staticmethod):
        return staticmethod(_documented(compiled.__get__(None, object), described.__func__))

    @functools.wraps(described)
    def member(*arguments: Any, **keywords: Any) -> Any:
        return compiled(*arguments, **keywords)

    member.__module__ = "hydroid"
    # What the compiled member itself states.
    member.__wrapped__ = compiled
    member.__signature__ = inspect.signature(described)  # type: ignore[attr-defined]
    return member


def _document() -> None:
    """Documents all compiled classes. The stub is Python without bodies, so that its classes are those of the text."""
    text = Path(__file__).with_name("_hydroid.pyi").read_text(encoding="utf-8")
    stub = types.ModuleType(f"{__package__}._stub")
    stub.__package__ = __package__
    exec(compile("from __future__ import annotations\n" + text, "_hydroid.pyi", "exec"), vars(stub))
    for name, described in vars(stub).items():
        compiled = getattr(_hydroid, name, None)
        if not isinstance(described, type) or described.__module__ != stub.__name__ or compiled is None:
            continue
        compiled.__doc__ = described.__doc__
        if "__new__" in vars(described):
            compiled.__signature__ = inspect.signature(described)
        for member, of in vars(described).items():
            if not member.startswith("_"):
                setattr(compiled, member, _documented(vars(compiled)[member], of))


def _with_warm_up(predict: Callable[..., Any]) -> Callable[..., Any]:
    """`Model.predict` with NaN where the history is shorter than the warm-up."""

    @functools.wraps(predict)
    def checked(self: Model, outputs: Any, inputs: Any, commands: Any) -> Any:
        ahead = predict(self, outputs, inputs, commands)
        if len(outputs) < self.warm_up:
            warn_of_warm_up(self, len(outputs))
            ahead[:] = float("nan")
        return ahead

    return checked


def _from_one_sample(simulate: Callable[..., Any]) -> Callable[..., Any]:
    """`Model.simulate` with a warning where one sample is no start."""

    @functools.wraps(simulate)
    def checked(self: Model, *arguments: Any, **keywords: Any) -> Any:
        if self.warm_up > 1:
            warnings.warn(
                f"{self.name} needs {self.warm_up} samples for its first prediction: as many samples of a simulation from "
                "one sample are not valid; use predict with a history",
                stacklevel=2,
            )
        return simulate(self, *arguments, **keywords)

    return checked


def warn_of_warm_up(model: Model, samples: int) -> None:
    """Warns that predictions after so few samples are NaN."""
    warnings.warn(
        f"{model.name} predicts from its sample {model.warm_up} on: predictions from {samples} or fewer are NaN",
        stacklevel=3,
    )


_document()
Model.predict = _with_warm_up(Model.predict)  # type: ignore[method-assign]
Model.simulate = _from_one_sample(Model.simulate)  # type: ignore[method-assign]
Session.__copy__ = lambda self: self.fork()  # type: ignore[attr-defined]
Session.__deepcopy__ = lambda self, memo: self.fork()  # type: ignore[attr-defined]
