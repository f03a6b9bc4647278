def _logistic(x):
    """1 / (1 + exp(-x)), in a form without overflow in its derivatives."""
    return 0.5 + 0.5 * ca.tanh(0.5 * x)
