"""Remakes tests/golden/direct/perceptron.json with PyTorch: what a feed-forward network gives, the mean square error, and its
gradient, in double precision. Weights, inputs and targets come from a rule that the test has as well, so that the file holds
results alone: number k is 0.8 sin(0.7 k + 0.3) / sqrt(columns) in a matrix, 0.1 sin(k) in a bias, sin(0.3 k) in inputs and
cos(0.2 k) in targets.

direct_golden.py [--write]: without --write it says how far the file is from what PyTorch gives now."""

import json
import pathlib
import sys

import torch

FILE = pathlib.Path(__file__).resolve().parent.parent / "golden" / "direct" / "perceptron.json"
SIZES, WINDOWS = [11, 17, 6, 5], 9

torch.set_default_dtype(torch.float64)
count = lambda shape: torch.arange(torch.Size(shape).numel(), dtype=torch.float64).reshape(shape)
layers = []
for reads, gives in zip(SIZES, SIZES[1:]):
    layer = torch.nn.Linear(reads, gives)
    with torch.no_grad():
        layer.weight.copy_(0.8 * torch.sin(0.7 * count((gives, reads)) + 0.3) / reads**0.5)
        layer.bias.copy_(0.1 * torch.sin(count((gives,))))
    layers += [layer, torch.nn.Tanh()]
network = torch.nn.Sequential(*layers[:-1])
output = network(torch.sin(0.3 * count((WINDOWS, SIZES[0]))))
loss = ((output - torch.cos(0.2 * count((WINDOWS, SIZES[-1])))) ** 2).mean()
loss.backward()
made = {
    "sizes": SIZES,
    "windows": WINDOWS,
    "output": output.tolist(),
    "loss": loss.item(),
    "gradient": {name: weight.grad.tolist() for name, weight in network.named_parameters()},
}
if "--write" in sys.argv[1:]:
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(json.dumps(made) + "\n")
golden = json.loads(FILE.read_text())
far = lambda a, b: (torch.tensor(a) - torch.tensor(b)).abs().max().item()
print(f"output: largest difference {far(made['output'], golden['output']):.1e}")
print(f"loss: difference {abs(made['loss'] - golden['loss']):.1e}")
for name, stands in golden["gradient"].items():
    print(f"gradient of {name}: largest difference {far(made['gradient'][name], stands):.1e}")
