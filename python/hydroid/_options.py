"""Options of reading as the section ``[log]`` of ``hydroid.toml``."""

from __future__ import annotations

import difflib
import functools
import inspect
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, Union

from . import _hydroid

Channels = Union[str, Sequence[str], Mapping[str, str]]


class LogWarning(UserWarning):
    """What was found or changed in a log while it was prepared."""


def channels(argument: str, given: Channels) -> list[str]:
    """Channels as ``NAME`` or ``NAME=COLUMN [unit]``."""
    if isinstance(given, str):
        return [part.strip() for part in given.split(",")]
    if isinstance(given, Mapping):
        return [f"{name}={column}" for name, column in given.items()]
    if isinstance(given, Sequence) and all(isinstance(name, str) for name in given):
        return list(given)
    raise TypeError(
        f"{argument}: expected 'u,v,r', a list of names or a mapping from names to columns, got {type(given).__name__}"
    )


def tables(argument: str, given: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
    """Sections of ``hydroid.toml`` as dictionaries."""
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not all(isinstance(section, Mapping) for section in given.values()):
        raise TypeError(f"{argument}: expected a mapping from sections to their keys, got {given!r}")
    for name, section in given.items():
        for key, value in section.items():
            # It would be left out, whether the section has the key or not.
            if value is None:
                raise ValueError(f"{name}.{key}: expected a value, got None; leave the key out for its default")
    return {name: dict(section) for name, section in given.items()}


Function = TypeVar("Function", bound=Callable[..., Any])

#: Options of the library that Python has in another form.
_OTHERS = {"no_guard": "guard"}


def takes(section: str) -> Callable[[Function], Function]:
    """Gives a function or class with ``**options`` the options of the library: its signature and documentation name them.

    The line ``**options`` of the documentation becomes a list of them. Names that are no option are refused.
    """
    known = [option for option in _hydroid.options(section) if option["key"] not in _OTHERS]

    def documented(text: str | None, own: list[dict[str, Any]]) -> str:
        entries = "".join(_entry(option) for option in own)
        return re.sub(r"(?m)^    \*\*options\n", lambda _: entries, text or "")

    def decorate(function: Function) -> Function:
        if isinstance(function, type):
            known_to_class = inspect.signature(function).parameters
            function.__init__ = decorate(function.__init__)  # type: ignore[misc]
            function.__doc__ = documented(function.__doc__, [o for o in known if o["key"] not in known_to_class])
            return function
        name = function.__qualname__.removesuffix(".__init__")

        @functools.wraps(function)
        def checked(*arguments: Any, **keywords: Any) -> Any:
            for key in keywords:
                if key not in parameters:
                    near = difflib.get_close_matches(key, parameters, 1)
                    hint = f"; did you mean '{near[0]}'?" if near else ""
                    raise TypeError(f"{name}() got an unexpected keyword argument '{key}'{hint}")
            return function(*arguments, **keywords)

        signature = inspect.signature(function)
        fixed = [p for p in signature.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
        own = [option for option in known if option["key"] not in signature.parameters]
        options = [inspect.Parameter(option["key"], inspect.Parameter.KEYWORD_ONLY, default=None) for option in own]
        parameters = [p.name for p in fixed + options]
        checked.__signature__ = signature.replace(parameters=fixed + options)  # type: ignore[attr-defined]
        checked.__doc__ = documented(function.__doc__, own)
        return checked  # type: ignore[return-value]

    return decorate


def _entry(option: dict[str, Any]) -> str:
    """An option in the form of numpydoc."""
    choices = [name for name, _ in option["choices"]]
    kind = "{" + ", ".join(f"'{name}'" for name in choices) + "}" if choices else option["kind"]
    lines = [option["text"] + "."] + [f"``{name}``: {text}." for name, text in option["choices"] if text]
    filled = (textwrap.fill(line, 116, initial_indent=" " * 8, subsequent_indent=" " * 8) for line in lines)
    return f"    {option['key']} : {kind}, optional\n" + "".join(line + "\n" for line in filled)


def by_name(argument: str, given: Mapping[str, Any] | str) -> dict[str, Any] | str:
    """Values by name: a mapping, or the text ``NAME=VALUE,NAME=VALUE``."""
    if isinstance(given, str):
        return given
    if not isinstance(given, Mapping):
        raise TypeError(f"{argument}: expected a mapping or 'NAME=VALUE', got {type(given).__name__}")
    return dict(given)


def log_section(
    outputs: Channels | None = None,
    inputs: Channels | None = None,
    heading: str | None = None,
    wind: str | Sequence[str] | None = None,
    time: str | None = None,
    **options: Any,
) -> dict[str, Any]:
    section: dict[str, Any] = dict(options)
    for name, given in (("outputs", outputs), ("inputs", inputs)):
        if given is not None:
            section[name] = channels(name, given)
    if wind is not None:
        section["wind"] = wind if isinstance(wind, str) else ",".join(wind)
    for name, value in (("heading", heading), ("time", time)):
        if value is not None:
            section[name] = value
    return section


class Bar:
    """Progress through tqdm if it is installed and wanted."""

    def __init__(self, wanted: bool | Callable[[float], object], what: str) -> None:
        self._bar: Any = None
        self._call: Callable[[float], object] | None = None
        if callable(wanted):
            self._call = wanted
        elif wanted:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self._bar = tqdm(total=1.0, desc=what, bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}")
            self._call = self._update

    def _update(self, fraction: float) -> None:
        self._bar.update(fraction - self._bar.n)

    @property
    def callback(self) -> Callable[[float], object] | None:
        return self._call

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
