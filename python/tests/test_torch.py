"""A model of PyTorch is judged by hydroid's judge."""

import numpy as np
import pytest

import hydroid
from conftest import CHANNELS

torch = pytest.importorskip("torch")


class Boat(torch.nn.Module):
    """du/dt = a u |u| + b n, dr/dt = c r + d u delta, with the coefficients of the boat of these tests."""

    def __init__(self):
        super().__init__()
        self.weights = torch.nn.Parameter(torch.tensor([-0.2, 0.01, -0.8, 0.5], dtype=torch.float64))

    def rate(self, state, command):
        u, r = state
        a, b, c, d = self.weights
        return torch.stack([a * u * u.abs() + b * command[0], c * r + d * u * command[1]])

    def forward(self, state, commands, dt=0.1):
        states = []
        for command in commands:
            middle = state + 0.5 * dt * self.rate(state, command)
            state = state + dt * self.rate(middle, command)
            states.append(state)
        return torch.stack(states)


def test_a_model_of_torch(files):
    boat = Boat()

    def predict(outputs, inputs, commands):
        with torch.no_grad():
            return boat(torch.tensor(outputs[-1]), torch.tensor(commands)).numpy()

    judged = hydroid.evaluate(predict, files[3], **CHANNELS, horizon=50, stride=25, name="torch")
    assert judged.model == "torch" and judged.windows > 40
    # The true coefficients: what is left is the noise of the measurements.
    assert judged.rmse.max() < 0.01
    # The training of a network sees the same arrays.
    run = hydroid.prepare(files[0], **CHANNELS)[0]
    steps = boat(torch.tensor(run.outputs[0]), torch.tensor(run.inputs[:40]))
    loss = ((steps - torch.tensor(run.outputs[1:41])) ** 2).mean()
    loss.backward()
    assert torch.isfinite(boat.weights.grad).all() and loss.item() < 1e-3


def test_a_function_that_forgets_to_detach(files):
    boat = Boat()

    def predict(outputs, inputs, commands):
        return boat(torch.tensor(outputs[-1]), torch.tensor(commands))

    with pytest.raises(Exception, match="detach|array of numbers"):
        hydroid.evaluate(predict, files[3], **CHANNELS, horizon=10, stride=500)
