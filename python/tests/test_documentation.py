"""What `help` shows, and the stub, against what the compiled part does."""

import inspect
import pathlib
import pickle

import pytest

import hydroid
from hydroid import _hydroid

#: Public classes and functions.
PUBLIC = [getattr(hydroid, name) for name in hydroid.__all__ if name != "__version__"]


def members(cls):
    """Public members by name, as they are written in a class; fields of named tuples have comments."""
    for base in cls.__mro__:
        if base.__module__.partition(".")[0] != "hydroid":
            continue
        for name, member in vars(base).items():
            if not name.startswith("_") and (callable(member) or isinstance(member, (property, staticmethod))):
                yield name, member


@pytest.mark.parametrize("public", PUBLIC, ids=lambda public: public.__name__)
def test_help_has_the_text_of_every_class_method_and_argument(public):
    missing = []
    for name, member in [("", public), *(members(public) if isinstance(public, type) else ())]:
        text = inspect.getdoc(member)
        if not text:
            missing.append(f"{name}: no text")
            continue
        if isinstance(member, property) or isinstance(member, type) and issubclass(member, (tuple, Warning)):
            continue
        try:
            parameters = inspect.signature(getattr(public, name) if name else public).parameters
        except ValueError:
            continue  # A class that has no constructor.
        for parameter in parameters.values():
            if parameter.name not in ("self", "inner", "store", "records", "document", "progress"):
                if parameter.name not in text:
                    missing.append(f"{name}: {parameter.name}")
    assert not missing, missing


def test_the_stub_has_the_members_signatures_and_defaults_of_run_time():
    text = pathlib.Path(hydroid.__file__).with_name("_hydroid.pyi").read_text()
    stub = {"__name__": "hydroid._stub", "__package__": "hydroid"}
    exec("from __future__ import annotations\n" + text, stub)
    differences = []

    def compare(name, described, compiled):
        compiled = getattr(compiled, "__wrapped__", compiled)
        compiled = getattr(compiled, "__wrapped__", compiled)
        try:
            found = inspect.signature(compiled)
        except ValueError:
            return
        wanted = inspect.signature(described)
        a, b = ([(p.name, p.kind, p.default) for p in of.parameters.values() if p.name not in ("self", "cls")] for of in (wanted, found))
        # A default that has no text in Rust is unknown at run time.
        plain = lambda ps: [(n, k is inspect.Parameter.KEYWORD_ONLY, d) for n, k, d in ps]
        a, b = plain(a), [(n, k, was[2] if d is ... else d) for (n, k, d), was in zip(plain(b), plain(a))]
        if a != b or len(wanted.parameters) != len(found.parameters):
            differences.append(f"{name}: stub {wanted}, run time {found}")

    for name, described in stub.items():
        if inspect.isfunction(described) and described.__module__ == "hydroid._stub":
            compare(name, described, getattr(_hydroid, name))
        elif isinstance(described, type) and described.__module__ == "hydroid._stub":
            compiled = getattr(_hydroid, name)
            names = {member for member in vars(described) if not member.startswith("_")}
            assert names == {member for member in dir(compiled) if not member.startswith("_")}, name
            for member in names:
                of = getattr(described, member)
                if inspect.isfunction(of):
                    compare(f"{name}.{member}", of, getattr(compiled, member))
    known = {name for name in dir(_hydroid) if not name.startswith("_")}
    assert known <= set(stub), known - set(stub)
    assert not differences, differences


def test_defaults_in_help_are_true():
    signature = inspect.signature(hydroid.Adapter)
    assert signature.parameters["guard"].default is True and signature.parameters["leak"].default is None
    for option in hydroid._hydroid.options("adapt"):
        assert option["key"] == "no_guard" or f"{option['key']} :" in hydroid.Adapter.__doc__, option["key"]
    assert inspect.signature(hydroid.Log).parameters["name"].default == hydroid.Log({"a": [1.0]}).name


def test_methods_with_documentation_are_those_of_the_compiled_part(model):
    again = pickle.loads(pickle.dumps(model))
    assert again.predict.__self__ == model and hydroid.Model.load("simple").name == "simple"
    with pytest.raises(TypeError, match="horizon"):
        model.session().rollout([[0.0, 0.0]], horizon=3)
