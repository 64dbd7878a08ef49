"""Records what PyTorch says of a small posterior network, for the test of the one in Rust.

    python3 tests/peers/pytorch_posterior.py        # writes crates/prior/tests/data/posterior
"""

import json
import os
import sys

import torch

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
sys.path.insert(0, os.path.join(ROOT, "training"))
import posterior  # noqa: E402

OUT = os.path.join(ROOT, "crates/prior/tests/data/posterior")
STEPS = 6


def main():
    torch.manual_seed(7)
    with open(os.path.join(OUT, "about.json")) as file:
        about = json.load(file)
    steps = torch.zeros(1, STEPS, posterior.STEP_VALUES)
    steps[0, :, 0] = torch.tensor([-1.0, 0, 3, 9, 3, 2])
    steps[0, :, 1:4] = torch.tensor([0.55, -0.1, 0.0]) + 0.02 * torch.randn(STEPS, 3)
    steps[0, :, 4:10] = torch.randn(STEPS, 6) * torch.tensor([20.0, 5, 30, 2, 1, 0.3])
    steps[0, :, 10:13] = torch.tensor([0.6, 0.0, 0.0]) + 0.03 * torch.randn(STEPS, 3)
    q = torch.randn(STEPS, 4)
    steps[0, :, 13:17] = q / q.norm(dim=-1, keepdim=True) * q[:, 3:].sign()
    x = posterior.features(steps, about["force_scale"])
    network = posterior.Network(x.shape[-1], 6, 3, 2, 0.0).eval()
    network.norm_m.data.normal_()
    network.norm_s.data.uniform_(0.5, 2.0)
    cases = []
    for pair in range(posterior.PAIRS):
        z = torch.randn(1, posterior.COORDINATES)
        with torch.no_grad():
            _, log_density, log_pairs = network(x, torch.tensor([pair]), z)
        awake = posterior.AWAKE[pair]
        normal = ((-0.5 * z * z - posterior.HALF_LOG_TAU) * awake).sum()
        cases.append({"pair": pair, "z": z[0].tolist(), "log_ratios": (log_density[0] - normal).tolist()})
    for name in os.listdir(OUT):
        if name.endswith(".safetensors"):
            os.remove(os.path.join(OUT, name))
    posterior.write(OUT, network.state_dict(), about, {"program": "tests/peers/pytorch_posterior.py"})
    expected = {"steps": steps[0].tolist(), "log_pairs": log_pairs[0].tolist(), "cases": cases}
    with open(os.path.join(OUT, "expected.json"), "w") as file:
        json.dump(expected, file)
        file.write("\n")


if __name__ == "__main__":
    main()
