"""Equations as expressions of SymPy."""

from __future__ import annotations

from typing import Any

from ._hydroid import Model


def to_sympy(model: Model) -> dict[Any, Any]:
    try:
        import sympy
    except ImportError as error:
        raise ImportError("to_sympy needs SymPy: pip install sympy") from error
    functions = {
        "power": lambda x, n: x ** int(n),
        "abs": sympy.Abs,
        "sign": sympy.sign,
        "sin": sympy.sin,
        "cos": sympy.cos,
        "reciprocal": lambda x: 1 / x,
        "log": sympy.log,
        "above": lambda x, centre, slope: 1 / (1 + sympy.exp(-slope * (x - centre))),
        "below": lambda x, centre, slope: 1 / (1 + sympy.exp(slope * (x - centre))),
    }

    def symbol(name: str) -> Any:
        return sympy.Symbol(name, real=True)

    def product(coefficient: float, factors: list[tuple[str, str, list[float]]]) -> Any:
        of = (functions[function](symbol(name), *parameters) for name, function, parameters in factors)
        return sympy.Mul(sympy.Float(coefficient), *of)

    equations, signals = model.terms()
    sides = {
        symbol(name): sympy.Add(*(product(coefficient, factors) for coefficient, factors in terms))
        for name, terms in zip(model.output_names, equations)
    }
    for name, kind, source, number in signals:
        if kind == "lag":
            sides[symbol(name)] = (symbol(source) - symbol(name)) / number
    return sides
