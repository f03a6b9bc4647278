"""Options of reading as the section ``[log]`` of ``hydroid.toml``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

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
    return {name: dict(section) for name, section in given.items()}


def names(argument: str, given: str | Sequence[str]) -> list[str]:
    if isinstance(given, str):
        return [name.strip() for name in given.split(",")]
    if isinstance(given, Sequence) and all(isinstance(name, str) for name in given):
        return list(given)
    raise TypeError(f"{argument}: expected 'a,b' or a list of names, got {given!r}")


def by_name(argument: str, given: Mapping[str, Any] | str | None) -> dict[str, Any] | str:
    """Values by name: a mapping, or the text ``NAME=VALUE,NAME=VALUE``."""
    if given is None:
        return {}
    if isinstance(given, str):
        return given
    if not isinstance(given, Mapping):
        raise TypeError(f"{argument}: expected a mapping or 'NAME=VALUE', got {type(given).__name__}")
    return dict(given)


def roles(given: Mapping[str, str] | str | None) -> dict[str, Any] | str:
    return by_name("role", given)


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
