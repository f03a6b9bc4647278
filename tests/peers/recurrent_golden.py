"""Remakes states and outputs in tests/golden/networks with PyTorch, from the weights and inputs that stand there.

recurrent_golden.py [--write]: without --write it says how far the files are from what PyTorch gives now. (Loss,
gradients and Jacobians of the files come from the same networks; hydroid-core's tests compare with them.)"""

import json
import pathlib
import sys

import torch
from safetensors.torch import load_file

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "golden" / "networks"
NETWORKS = {
    "lstm": lambda: (torch.nn.LSTM(2, 18, proj_size=3), torch.nn.Identity()),
    "gru": lambda: (torch.nn.GRU(2, 18), torch.nn.Linear(18, 3)),
    "rnn": lambda: (torch.nn.RNN(2, 18, 2), torch.nn.Linear(18, 3)),
}

for name, make in NETWORKS.items():
    rnn, linear = (module.double() for module in make())
    tensors = load_file(FOLDER / f"{name}_weights.safetensors")
    rnn.load_state_dict({k: t for k, t in tensors.items() if not k.startswith("linear.")})
    linear.load_state_dict({k[7:]: t for k, t in tensors.items() if k.startswith("linear.")})
    path = FOLDER / f"{name}_golden.json"
    golden = json.loads(path.read_text())
    inputs = torch.tensor(golden["sequence"]["input"], dtype=torch.float64)
    outputs, states, memory = [], [], None
    with torch.no_grad():
        for row in inputs:
            shown, memory = rnn(row[None], memory)
            outputs.append(linear(shown)[0].tolist())
            parts = [memory[1], memory[0]] if name == "lstm" else [memory]
            states.append(torch.cat([part.flatten() for part in parts]).tolist())
    for key, made in [("output", outputs), ("state", states)]:
        stands = torch.tensor(golden["sequence"][key], dtype=torch.float64)
        far = (torch.tensor(made, dtype=torch.float64) - stands).abs().max()
        print(f"{name} {key}: largest difference {far:.1e}")
        golden["sequence"][key] = made
    if "--write" in sys.argv[1:]:
        path.write_text(json.dumps(golden, indent=1) + "\n")
