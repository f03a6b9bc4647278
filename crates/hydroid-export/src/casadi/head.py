import casadi as ca


def _function(symbols, result, **arguments):
    """Makes a casadi.Function of columns with the named lengths from a function of symbols."""

    def of(body):
        given = [symbols.sym(name, length) for name, length in arguments.items()]
        value = ca.densify(symbols(body(*given)))
        return ca.Function(body.__name__.lstrip("_"), given, [value], list(arguments), [result])

    return of
