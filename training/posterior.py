"""Trains the posterior network of the bridge filter: what an episode's readings say of its start.

    cargo xtask posterior-data --data runs/data/sawyer-fixed --set data.movable_share=0.0 ... --out runs/starts/sawyer-fixed
    python3 training/posterior.py --train runs/starts/sawyer-fixed --held-out runs/starts/sawyer-fixed-2 --out runs/priors/sawyer-fixed

The network is an LSTM over the steps, a softmax of the pairs of classes (shape of the object, of the obstacle), and a masked autoregressive
density of the 18 standard normal coordinates given the pair (Papamakarios, Pavlakou and Murray 2017): each coordinate has hidden units of its
own, which see the LSTM's output, the pair, and the coordinates before it, and give a mixture of Gaussians. The loss is -ln p(pair, coordinates)
at every step. The weights of the epoch that is best on the held-out episodes are kept.

Runs on a GPU where there is one, else on the CPU. The seed decides the first weights and the order of the episodes; floating-point sums of a GPU do not
repeat bit by bit, so a second training gives another network of the same quality. `crates/prior/src/posterior` has the same network in Rust.
"""

import argparse
import json
import math
import os
import struct
import time

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

PAIRS, COORDINATES, STEP_VALUES, ACTIONS = 12, 18, 17, 10
# Coordinates that a shape of the object, or of the obstacle, uses.
OBJECT = {0: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10], 1: [0, 1, 2, 3, 4, 5, 6, 8, 9, 10], 2: [0, 1, 4, 5, 8, 9, 10]}
OBSTACLE = {0: [11, 12, 13, 14, 15, 16, 17], 1: [11, 12, 13, 15, 16, 17], 2: [11, 12, 15, 16, 17], 3: []}
AWAKE = torch.zeros(PAIRS, COORDINATES)
for pair in range(PAIRS):
    AWAKE[pair, OBJECT[pair // 4] + OBSTACLE[pair % 4]] = 1.0
# The obstacle's place and size first, then the object's sizes, pose, centre of mass, friction and mass.
ORDER = [15, 16, 17, 12, 13, 14, 11, 5, 6, 7, 8, 9, 10, 2, 3, 4, 1, 0]
HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)


def load(folder):
    """Pairs [n], coordinates [n, 18], steps [n, steps, 17], and what the file is."""
    with open(os.path.join(folder, "starts.json")) as file:
        about = json.load(file)
    expected = {"version": 1, "coordinates": COORDINATES, "step_values": STEP_VALUES}
    for key, value in expected.items():
        if about[key] != value:
            raise SystemExit(f"{folder}/starts.json: {key} is {about[key]}, expected {value}")
    width = 2 + COORDINATES + about["steps"] * STEP_VALUES
    rows = np.fromfile(os.path.join(folder, "starts.f32"), dtype="<f4").reshape(-1, width)
    pairs = torch.from_numpy((4 * rows[:, 0] + rows[:, 1]).astype(np.int64))
    z = torch.from_numpy(rows[:, 2 : 2 + COORDINATES].copy())
    steps = torch.from_numpy(rows[:, 2 + COORDINATES :].reshape(len(rows), about["steps"], STEP_VALUES).copy())
    return pairs, z, steps, about


def features(steps, force_scale):
    """[n, steps, 17] of action, tool (3, m), force (6), position (3, m), orientation (4) -> [n, steps, 43]."""
    action, tool, position, q = steps[..., 0].long(), steps[..., 1:4], steps[..., 10:13], steps[..., 13:17]
    force = steps[..., 4:10] / steps.new_tensor(force_scale)
    before = lambda values: torch.cat([values[:, :1], values[:, :-1]], 1)
    wrap = lambda angle: torch.remainder(angle + math.pi, 2 * math.pi) - math.pi
    # The twist about the vertical.
    yaw = 2 * torch.atan2(q[..., 2:3], q[..., 3:4])
    columns = [
        F.one_hot(action + 1, ACTIONS + 1)[..., 1:].float(),
        (tool - tool.new_tensor([0.6, 0.0, 0.0])) / 0.1,
        (position - tool) / 0.05,
        (position - before(position)) / 0.01,
        (position - position[:, :1]) / 0.05,
        (tool - before(tool)) / 0.02,
        q[..., :2] / 0.02,
        wrap(yaw - before(yaw)) / 0.05,
        wrap(yaw - yaw[:, :1]) / 0.3,
        torch.sin(yaw),
        torch.cos(yaw),
        torch.asinh(force / 2) / 2,
        force / 50,
    ]
    return torch.cat(columns, -1).clamp(-20, 20)


class Head(nn.Module):
    """ln of the density of coordinates given a pair."""

    def __init__(self, width, units, components):
        super().__init__()
        self.components, self.units = components, units
        rank = torch.empty(COORDINATES, dtype=torch.long)
        rank[torch.tensor(ORDER)] = torch.arange(COORDINATES)
        self.register_buffer("zm", (rank[None, :] < rank[:, None]).float().repeat_interleave(units, 0))
        self.c = nn.Linear(width, COORDINATES * units)
        self.k = nn.Linear(PAIRS, COORDINATES * units, bias=False)
        self.zw = nn.Parameter(torch.randn(COORDINATES * units, 2 * COORDINATES) * 0.2)
        self.w = nn.Parameter(torch.randn(COORDINATES, units, 3 * components) / math.sqrt(units))
        self.b = nn.Parameter(torch.zeros(COORDINATES, 3 * components))
        with torch.no_grad():
            self.b[:, components : 2 * components] = torch.linspace(-1, 1, components)

    def mixture(self, top, pair, z, awake):
        """Weights (before a softmax), means and ln of the spreads of each coordinate's Gaussians, given the coordinates before it."""
        seen = torch.cat([z * awake, awake], -1)
        hidden = self.c(top) + self.k(pair) + F.linear(seen, self.zw * torch.cat([self.zm, self.zm], -1))
        hidden = torch.tanh(hidden).unflatten(-1, (COORDINATES, self.units))
        out = torch.einsum("...cg,cgk->...ck", hidden, self.w) + self.b
        weights, means, log_stddevs = out.split(self.components, -1)
        return weights, means, log_stddevs.clamp(-6, 3)

    def forward(self, top, pair, z, awake):
        weights, means, log_stddevs = self.mixture(top, pair, z, awake)
        error = (z.unsqueeze(-1) - means) * torch.exp(-log_stddevs)
        logs = F.log_softmax(weights, -1) - 0.5 * error * error - log_stddevs - HALF_LOG_TAU
        return (torch.logsumexp(logs, -1) * awake).sum(-1)


class Network(nn.Module):
    def __init__(self, inputs, hidden, units, components, dropout):
        super().__init__()
        self.norm_m = nn.Parameter(torch.zeros(inputs), requires_grad=False)
        self.norm_s = nn.Parameter(torch.ones(inputs), requires_grad=False)
        self.lstm = nn.LSTM(inputs, hidden, 2, batch_first=True, dropout=dropout)
        self.cls = nn.Linear(hidden, PAIRS)
        self.head = Head(hidden, units, components)
        self.drop = nn.Dropout(dropout)

    def forward(self, x, pairs, z):
        """ln p(pair), ln p(z | pair) and ln p of every pair after each step."""
        top = self.drop(self.lstm((x - self.norm_m) / self.norm_s)[0])
        log_pairs = F.log_softmax(self.cls(top), -1)
        spread = lambda values: values[:, None].expand(-1, top.shape[1], -1)
        of_pair = log_pairs.gather(-1, spread(pairs[:, None]))[..., 0]
        one_hot = F.one_hot(pairs, PAIRS).float()
        log_density = self.head(top, spread(one_hot), spread(z), spread(AWAKE.to(x.device)[pairs]))
        return of_pair, log_density, log_pairs


@torch.no_grad()
def judge(network, data, device):
    """Means over held-out episodes: gain over N(0, I) and uniform pairs, all steps; Brier of the obstacle and -ln P(shape) at the last."""
    network.eval()
    pairs, z, x = data
    sums = np.zeros(4)
    for first in range(0, len(pairs), 1000):
        pair, start, rows = (part[first : first + 1000].to(device) for part in (pairs, z, x))
        of_pair, log_density, log_pairs = network(rows, pair, start)
        awake = AWAKE.to(device)[pair]
        normal = ((-0.5 * start * start - HALF_LOG_TAU) * awake).sum(-1)
        joint = log_pairs[:, -1].unflatten(-1, (3, 4))
        obstacle = 1 - joint.exp()[..., 3].sum(-1)
        shape = joint.logsumexp(-1).gather(-1, pair[:, None] // 4)
        brier = (obstacle - (pair % 4 < 3).float()) ** 2
        gain = (log_density - normal[:, None]).mean(-1)
        sums += [float(v.sum()) for v in (of_pair.mean(-1), gain, brier, -shape)]
    network.train()
    of_pair, gain, brier, shape = (float(v) for v in sums / len(pairs))
    return {"log_pair": of_pair, "gain": gain, "brier_obstacle": brier, "log_shape": shape}


def load_all(folders):
    """Pairs, coordinates and features of several folders of one kind, and what each file is."""
    parts, abouts = [], []
    for folder in folders:
        pairs, z, steps, about = load(folder)
        abouts.append(about)
        for key in ("robot", "mobility", "distribution", "force_scale", "steps"):
            if about[key] != abouts[0][key]:
                raise SystemExit(f"{folder}: {key} differs from that of {folders[0]}")
        if not steps.isfinite().all():
            raise SystemExit(f"{folder}: episodes of different lengths, expected those of cargo xtask posterior-data")
        parts.append((pairs, z, features(steps, about["force_scale"])))
    return [torch.cat(part) for part in zip(*parts)], abouts


def train(arguments, device):
    (pairs, z, x), abouts = load_all(arguments.train)
    held_out, (held_about,) = load_all([arguments.held_out])
    about = abouts[0]
    for key in ("robot", "mobility", "distribution", "force_scale"):
        if about[key] != held_about[key]:
            raise SystemExit(f"{arguments.held_out}: {key} differs from that of {arguments.train[0]}")
    network = Network(x.shape[-1], arguments.hidden, arguments.units, arguments.components, arguments.dropout)
    rows = x[:20000].reshape(-1, x.shape[-1])
    network.norm_m.data.copy_(rows.mean(0))
    network.norm_s.data.copy_(rows.std(0).clamp(min=1e-3))
    if arguments.init:
        network.load_state_dict(torch.load(arguments.init, map_location="cpu", weights_only=True))
    network.to(device)
    optimiser = torch.optim.AdamW(network.parameters(), lr=arguments.rate, weight_decay=arguments.weight_decay)
    batches, best, curve = len(pairs) // arguments.batch, None, []
    for epoch in range(arguments.epochs):
        order, started = torch.randperm(len(pairs)), time.time()
        for batch in range(batches):
            done = (epoch + batch / batches) / arguments.epochs
            warm = min(1.0, (epoch * batches + batch + 1) / 200)
            for group in optimiser.param_groups:
                group["lr"] = arguments.rate * warm * 0.5 * (1 + math.cos(math.pi * done))
            chosen = order[batch * arguments.batch : (batch + 1) * arguments.batch]
            with torch.autocast(device, dtype=torch.bfloat16, enabled=arguments.bf16):
                of_pair, log_density, _ = network(*(part[chosen].to(device) for part in (x, pairs, z)))
                loss = -(of_pair + log_density).mean()
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimiser.step()
        curve.append({"epoch": epoch + 1, **judge(network, held_out, device)})
        score = curve[-1]["log_pair"] + curve[-1]["gain"]
        print(f"epoch {epoch + 1}: {score:.4f} nats a step, {time.time() - started:.0f} s", curve[-1], flush=True)
        if best is None or score > best[0]:
            best = (score, {name: value.cpu().clone() for name, value in network.state_dict().items()})
    torch.save(best[1], os.path.join(arguments.out, "network.pt"))
    stage = {
        "data": [about["dataset"] for about in abouts],
        "held_out": held_about["dataset"],
        "settings": {k: v for k, v in vars(arguments).items() if k not in ("train", "held_out", "out", "init", "threads")},
        "continues": bool(arguments.init),
        "device": torch.cuda.get_device_name() if device == "cuda" else "cpu",
        "torch": torch.__version__,
        "curve": curve,
    }
    return best[1], about, stage


def write(folder, state, about, provenance):
    """posterior.json and its weights, in the form that crates/prior/src/posterior/file.rs reads."""
    from blake3 import blake3

    hidden, units = state["cls.weight"].shape[1], state["head.w"].shape[1]
    mask, of_z = state["head.zm"], state["head.zw"]
    tensors = {"input.mean": state["norm_m"], "input.stddev": state["norm_s"]}
    for layer in range(2):
        both = [state[f"lstm.weight_ih_l{layer}"].T, state[f"lstm.weight_hh_l{layer}"].T]
        tensors[f"layers.{layer}.weights"] = torch.cat(both, 0)
        tensors[f"layers.{layer}.bias"] = state[f"lstm.bias_ih_l{layer}"] + state[f"lstm.bias_hh_l{layer}"]
    tensors |= {
        "pairs.weights": state["cls.weight"].T,
        "pairs.bias": state["cls.bias"],
        "context.weights": state["head.c.weight"].T,
        "context.bias": state["head.c.bias"],
        "of_pair": state["head.k.weight"].T + AWAKE @ (of_z[:, COORDINATES:] * mask).T,
        "of_coordinate": (of_z[:, :COORDINATES] * mask).T,
        "out.weights": state["head.w"],
        "out.bias": state["head.b"],
    }
    header, blob = {}, b""
    for name, tensor in tensors.items():
        raw = tensor.contiguous().numpy().astype("<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(blob), len(blob) + len(raw)]}
        blob += raw
    text = json.dumps(header, separators=(",", ":"))
    text += " " * (-len(text) % 8)
    data = struct.pack("<Q", len(text)) + text.encode() + blob
    digest = blake3(data).hexdigest()
    name = f"weights-{digest[:12]}.safetensors"
    manifest = {
        "version": 1,
        "robot": about["robot"],
        "mobility": about["mobility"],
        "hidden": [hidden, hidden],
        "units": units,
        "components": state["head.w"].shape[2] // 3,
        "order": ORDER,
        "force_scale": about["force_scale"],
        "distribution": about["distribution"],
        "weights": {"name": name, "bytes": len(data), "blake3": digest},
        "provenance": provenance,
    }
    for path, content in ((name, data), ("posterior.json", (json.dumps(manifest, indent=1) + "\n").encode())):
        partial = os.path.join(folder, path + ".tmp")
        with open(partial, "wb") as file:
            file.write(content)
        os.replace(partial, os.path.join(folder, path))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--train", required=True, nargs="+", help="folders of cargo xtask posterior-data")
    parser.add_argument("--held-out", required=True, help="the same of another seed: chooses the epoch")
    parser.add_argument("--out", required=True, help="folder of the network")
    parser.add_argument("--init", help="network.pt to go on from, in the folder of its posterior.json")
    parser.add_argument("--hidden", type=int, default=256)
    parser.add_argument("--units", type=int, default=32, help="hidden units of a coordinate")
    parser.add_argument("--components", type=int, default=8, help="Gaussians of a coordinate")
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--batch", type=int, default=512, help="episodes")
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--weight-decay", type=float, default=0.01)
    parser.add_argument("--dropout", type=float, default=0.1)
    parser.add_argument("--bf16", action="store_true", help="products of matrices in bfloat16: on a CPU with it 1.7 times as fast")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0, help="of the CPU; 0: all")
    arguments = parser.parse_args()
    if os.path.exists(os.path.join(arguments.out, "posterior.json")):
        raise SystemExit(f"{arguments.out}/posterior.json exists: choose another --out or remove it")
    os.makedirs(arguments.out, exist_ok=True)
    if arguments.threads:
        torch.set_num_threads(arguments.threads)
    torch.manual_seed(arguments.seed)
    earlier = []
    if arguments.init:
        with open(os.path.join(os.path.dirname(arguments.init), "posterior.json")) as file:
            earlier = json.load(file)["provenance"]["stages"]
    state, about, stage = train(arguments, "cuda" if torch.cuda.is_available() else "cpu")
    write(arguments.out, state, about, {"program": "training/posterior.py", "stages": earlier + [stage]})


if __name__ == "__main__":
    main()
