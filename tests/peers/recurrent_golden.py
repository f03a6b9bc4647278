"""Remakes the files in tests/golden/networks with PyTorch, from the weights, inputs and targets that stand there: states,
outputs, loss and its gradient (through all steps), and the Jacobians of one step.

recurrent_golden.py [--write]: without --write it says how far the files are from what PyTorch gives now."""

import json
import pathlib
import sys

import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from torch.func import functional_call, jacrev

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "golden" / "networks"
NETWORKS = {
    "lstm": lambda: (torch.nn.LSTM(2, 18, proj_size=3), torch.nn.Identity()),
    "gru": lambda: (torch.nn.GRU(2, 18), torch.nn.Linear(18, 3)),
    "rnn": lambda: (torch.nn.RNN(2, 18, 2), torch.nn.Linear(18, 3)),
}


class Step(torch.nn.Module):
    """One step on a flat state: [c h] of the LSTM, [h_0 h_1 ..] of the others."""

    def __init__(self, name):
        super().__init__()
        self.rnn, self.linear = (module.double() for module in NETWORKS[name]())
        self.lstm = name == "lstm"

    def forward(self, state, x):
        if self.lstm:
            memory = (state[None, 18:], state[None, :18])
        else:
            memory = state.reshape(self.rnn.num_layers, -1)
        _, memory = self.rnn(x[None], memory)
        parts = [memory[1], memory[0]] if self.lstm else [memory]
        return torch.cat([part.flatten() for part in parts])

    def output(self, state):
        return self.linear(state[-self.rnn.hidden_size :]) if not self.lstm else state[18:]


class Output(torch.nn.Module):
    def __init__(self, step):
        super().__init__()
        self.step = step

    def forward(self, state):
        return self.step.output(state)


def flat(gradients, names, rows):
    """Derivatives by weight, side by side in the order of the flat weights; None is zero."""
    return torch.cat([gradients[name].reshape(rows, -1) for name in names], dim=1)


def far(made, stands):
    return (torch.as_tensor(made, dtype=torch.float64) - stands).abs().max().item()


for name in NETWORKS:
    step = Step(name)
    tensors = load_file(FOLDER / f"{name}_weights.safetensors")
    rename = lambda key: key if key.startswith("linear.") else f"rnn.{key}"
    step.load_state_dict({rename(key): tensor for key, tensor in tensors.items()})
    path = FOLDER / f"{name}_golden.json"
    golden = json.loads(path.read_text())
    sequence = golden["sequence"]
    double = lambda rows: torch.tensor(rows, dtype=torch.float64)
    inputs, targets = double(sequence["input"]), double(sequence["target"])

    states, outputs = [torch.zeros(len(sequence["state"][0]), dtype=torch.float64)], []
    for x in inputs:
        states.append(step(states[-1], x))
        outputs.append(step.output(states[-1]))
    loss = ((torch.stack(outputs) - targets) ** 2).mean()
    loss.backward()
    for key, made in [("output", outputs), ("state", states[1:])]:
        made = torch.stack(made).detach()
        print(f"{name} {key}: largest difference {far(made, double(sequence[key])):.1e}")
        sequence[key] = made.tolist()
    print(f"{name} loss: difference {abs(loss.item() - golden['loss']['value']):.1e}")
    golden["loss"]["value"] = loss.item()
    for key, stands in golden["loss"]["gradient"].items():
        made = step.get_parameter(rename(key)).grad
        print(f"{name} gradient of {key}: largest difference {far(made, double(stands)):.1e}")
        golden["loss"]["gradient"][key] = made.tolist()

    at = golden["jacobians"]["step"]
    order = [rename(weight["name"]) for weight in golden["weight_order"]]
    weights = {key: tensor.detach() for key, tensor in step.named_parameters()}
    before, after, x = states[at].detach(), states[at + 1].detach(), inputs[at]
    moved = lambda weights, state: functional_call(step, weights, (state, x))
    read = lambda weights, state: functional_call(
        Output(step), {f"step.{key}": tensor for key, tensor in weights.items()}, (state,)
    )
    made = {
        "state": before,
        "input": x,
        "state_next": after,
        "output": outputs[at].detach(),
        "dstate_next_dstate": jacrev(moved, 1)(weights, before),
        "dstate_next_dweights": flat(jacrev(moved, 0)(weights, before), order, len(before)),
        "dy_dstate": jacrev(read, 1)(weights, after),
        "dy_dweights": flat(jacrev(read, 0)(weights, after), order, len(outputs[at])),
    }
    jacobians = FOLDER / f"{name}_jacobians.safetensors"
    stand = load_file(jacobians)
    with safe_open(jacobians, "pt") as file:
        metadata = file.metadata()
    for key, tensor in made.items():
        print(f"{name} {key}: largest difference {far(tensor, stand[key]):.1e}")
    if "--write" in sys.argv[1:]:
        path.write_text(json.dumps(golden, indent=1) + "\n")
        save_file({key: tensor.contiguous() for key, tensor in made.items()}, jacobians, metadata=metadata)
