"""How often the intervals of a posterior network hold the truth, on episodes that it was not trained on.

    python3 training/coverage.py assets/priors/sawyer-fixed runs/starts/sawyer-fixed-33

The network's density is autoregressive, so that its distribution function of each true coordinate, given the readings and the true coordinates
before it, is uniform if it is calibrated (the probability integral transform; Rosenblatt 1952). For each coordinate and some steps the table has the share
in [0.05, 0.95], the root mean square of the same in normal coordinates, and in brackets the episodes that have the coordinate and have not ended: 0.90 and 1
are right, more than 1 is a network that is too sure or off.
"""

import argparse
import json
import os
import struct

import numpy as np
import torch
from torch.nn import functional as F

import posterior
from posterior import AWAKE, PAIRS

NAMES = ["mass", "friction", "centre of mass x", "centre of mass y", "centre of mass z", "size 0", "size 1", "size 2", "x", "y", "yaw"]
NAMES += [f"obstacle's {name}" for name in ("mass", "size 0", "size 1", "size 2", "x", "y", "yaw")]
STEPS = (0, 4, 9, 14, 24)


def read(folder):
    """The network of a folder that `posterior.write` has written."""
    with open(os.path.join(folder, "posterior.json")) as file:
        about = json.load(file)
    with open(os.path.join(folder, about["weights"]["name"]), "rb") as file:
        data = file.read()
    (length,) = struct.unpack("<Q", data[:8])
    tensors = {}
    for name, entry in json.loads(data[8 : 8 + length]).items():
        first, last = (8 + length + offset for offset in entry["data_offsets"])
        tensors[name] = torch.from_numpy(np.frombuffer(data[first:last], "<f4").reshape(entry["shape"]).copy())
    hidden = about["hidden"][0]
    network = posterior.Network(len(tensors["input.mean"]), hidden, about["units"], about["components"], 0.0)
    state = network.state_dict()
    state["norm_m"], state["norm_s"] = tensors["input.mean"], tensors["input.stddev"]
    for layer in range(2):
        weights, bias = tensors[f"layers.{layer}.weights"], tensors[f"layers.{layer}.bias"]
        state[f"lstm.weight_ih_l{layer}"], state[f"lstm.weight_hh_l{layer}"] = weights[:-hidden].T, weights[-hidden:].T
        state[f"lstm.bias_ih_l{layer}"], state[f"lstm.bias_hh_l{layer}"] = bias, torch.zeros_like(bias)
    state["cls.weight"], state["cls.bias"] = tensors["pairs.weights"].T, tensors["pairs.bias"]
    state["head.c.weight"], state["head.c.bias"] = tensors["context.weights"].T, tensors["context.bias"]
    # Which coordinates a pair has is part of what the file says of the pair.
    state["head.k.weight"] = tensors["of_pair"].T
    state["head.zw"] = torch.cat([tensors["of_coordinate"].T, torch.zeros_like(tensors["of_coordinate"].T)], -1)
    state["head.w"], state["head.b"] = tensors["out.weights"], tensors["out.bias"]
    network.load_state_dict(state)
    return network.eval(), about


@torch.no_grad()
def ranks(network, pairs, z, x):
    """Distribution function of each true coordinate after each step, [n, steps, 18]."""
    all_ranks = []
    for first in range(0, len(pairs), 500):
        pair, start, rows = (part[first : first + 500] for part in (pairs, z, x))
        top = network.lstm((rows - network.norm_m) / network.norm_s)[0]
        spread = lambda values: values[:, None].expand(-1, top.shape[1], -1)
        one_hot = F.one_hot(pair, PAIRS).float()
        weights, means, log_stddevs = network.head.mixture(top, spread(one_hot), spread(start), spread(AWAKE[pair]))
        below = torch.special.ndtr((spread(start).unsqueeze(-1) - means) * torch.exp(-log_stddevs))
        all_ranks.append((torch.softmax(weights, -1) * below).sum(-1))
    return torch.cat(all_ranks)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", help="folder of posterior.json")
    parser.add_argument("starts", help="folder of cargo xtask posterior-data, or starts of cargo xtask bench calibration")
    arguments = parser.parse_args()
    network, made_for = read(arguments.network)
    pairs, z, steps, about = posterior.load(arguments.starts)
    there = steps.isfinite().all(-1)
    for key in ("robot", "mobility", "distribution", "force_scale"):
        if about[key] != made_for[key]:
            raise SystemExit(f"{arguments.starts}: {key} differs from that of {arguments.network}")
    if made_for["order"] != posterior.ORDER:
        raise SystemExit(f"{arguments.network}: order is not that of training/posterior.py")
    found = ranks(network, pairs, z, posterior.features(steps.nan_to_num(), about["force_scale"]))
    ends = there.sum(1) - 1
    chosen = [step for step in STEPS if step < about["steps"]]
    titles = [f"after step {step}" for step in chosen] + ["at the end"]
    print("| coordinate | " + " | ".join(titles) + " |")
    print("|---|" + "---|" * len(titles))
    for coordinate, name in enumerate(NAMES):
        awake = AWAKE[pairs][:, coordinate] > 0
        if not awake.any():
            continue
        cells = []
        for step in [torch.full_like(ends, step) for step in chosen] + [ends]:
            # An episode that has ended earlier says nothing of a step.
            rows = (awake & (step <= ends)).nonzero()[:, 0]
            u = found[rows, step[rows], coordinate].double()
            if not len(u):
                cells.append("")
                continue
            covered = ((u >= 0.05) & (u <= 0.95)).double().mean()
            cells.append(f"{covered:.3f}, {torch.special.ndtri(u.clamp(1e-6, 1 - 1e-6)).square().mean().sqrt():.2f} ({len(u)})")
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
