"""A network of hydroid in PyTorch: loads a model file, predicts, changes the weights, writes a model file.

torch_network.py OURS THEIRS, inputs in physical units as one flat JSON list on standard input. Answers with the
predictions before and after the change, each a flat JSON list. docs/networks.md shows the same by hand."""

import json
import sys

import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file


def network(head):
    """Cell and read-out as torch modules, in double precision."""
    shape = head["structure"]["network"]
    cell, inputs = shape["cell"], shape["inputs"]
    kind = cell["cell"]
    if kind == "lstm":
        rnn = torch.nn.LSTM(inputs, cell["hidden"], proj_size=cell.get("projection") or 0)
        shown = cell.get("projection") or cell["hidden"]
    elif kind == "gru":
        rnn, shown = torch.nn.GRU(inputs, cell["hidden"]), cell["hidden"]
    else:
        rnn, shown = torch.nn.RNN(inputs, cell["hidden"], cell["layers"]), cell["hidden"]
    linear = torch.nn.Linear(shown, shape["outputs"]) if shape["read_out"] else torch.nn.Identity()
    return rnn.double(), linear.double()


def load(rnn, linear, tensors):
    rnn.load_state_dict({name: t for name, t in tensors.items() if not name.startswith("linear.")})
    linear.load_state_dict({name[7:]: t for name, t in tensors.items() if name.startswith("linear.")})


def predict(rnn, linear, scaling, commands):
    tensor = lambda name: torch.tensor(scaling[name], dtype=torch.float64)
    x = (commands - tensor("input_mean")) / tensor("input_scale")
    with torch.no_grad():
        y = tensor("output_mean") + tensor("correction_scale") * linear(rnn(x)[0])
    return y.flatten().tolist()


ours, theirs = sys.argv[1:]
tensors = load_file(ours)
with safe_open(ours, "pt") as file:
    metadata = file.metadata()
head = json.loads(metadata["hydroid"])
rnn, linear = network(head)
load(rnn, linear, tensors)
scaling = head["structure"]["scaling"]
commands = torch.tensor(json.load(sys.stdin), dtype=torch.float64)
commands = commands.reshape(-1, len(scaling["input_mean"]))
first = predict(rnn, linear, scaling, commands)
with torch.no_grad():
    for weight in [*rnn.parameters(), *linear.parameters()]:
        weight.mul_(0.75).add_(0.01)
second = predict(rnn, linear, scaling, commands)
state = dict(rnn.state_dict())
state.update({f"linear.{name}": t for name, t in linear.state_dict().items()})
save_file({name: t.contiguous() for name, t in state.items()}, theirs, metadata=metadata)
print(json.dumps([first, second]))
