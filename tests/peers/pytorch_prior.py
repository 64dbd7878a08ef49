"""The network of the prior in PyTorch: the same sizes, loss, data and order of training, timed on request.

python tests/peers/pytorch_prior.py prints its versions and answers one JSON object a line, as `cargo xtask bench prior` asks:

    {"do": "open", "folder": DIR, "threads": N}     reads problem.json, weights.safetensors and data.safetensors of DIR
    {"do": "epoch", "epoch": E, "loss": "mixture"}  one pass in the given order: CPU and wall seconds, mean loss; "square": the network alone
    {"do": "held_out"}                              negative log-likelihood of the held-out sequences, nats a step in original units
    {"do": "gradient", "count": N, "ours": FILE}    largest relative difference of our gradient on the first N sequences, in f32 or f64 as FILE
    {"do": "step", "calls": N, "compile": false}    one observation in, one mixture out: microseconds of CPU time a call, variant by variant
    {"do": "outputs", "ours": FILE}                 largest difference of our outputs for the observations in FILE, step by step

python tests/peers/pytorch_prior.py --reference FILE writes a small network with its loss and gradient in f64, which tests read;
--optimiser FILE writes steps of Adam and AdamW.
Exits with status 3 and says what is missing where PyTorch is not installed. Times are CPU time of the process.
"""

import json
import math
import sys
import time

try:
    import numpy
    import torch
except ImportError:
    print("missing: pip install torch==2.15.0 numpy", file=sys.stderr)
    sys.exit(3)

from torch.nn.functional import log_softmax

LOG_STDDEV_LIMITS = (-5.0, 3.0)
HALF_LOG_TAU = 0.5 * math.log(2 * math.pi)
TYPES = {"F32": numpy.float32, "F64": numpy.float64, "U8": numpy.uint8, "I64": numpy.int64}


def read_tensors(path):
    """Arrays of a safetensors file by name."""
    with open(path, "rb") as file:
        length = int.from_bytes(file.read(8), "little")
        header = json.loads(file.read(length))
        data = file.read()
    read = lambda e: numpy.frombuffer(data[slice(*e["data_offsets"])], TYPES[e["dtype"]]).reshape(e["shape"])
    return {name: torch.tensor(read(entry)) for name, entry in header.items()}


class Prior(torch.nn.Module):
    """LSTM layers and one linear map to logits, means, log scales and class logits of all components."""

    def __init__(self, sizes, dtype=torch.float32):
        super().__init__()
        widths = [sizes["observations"], *sizes["hidden"]]
        if len(set(widths[1:])) != 1:
            raise ValueError(f"layers of one width expected, found {widths[1:]}")
        components, continuous, labels = sizes["components"], sizes["continuous"], sum(sizes["classes"])
        self.sizes = sizes
        self.parts = [components, components * continuous, components * continuous, components * labels]
        self.lstm = torch.nn.LSTM(widths[0], widths[1], len(widths) - 1, dtype=dtype)
        self.heads = torch.nn.Linear(widths[1], sum(self.parts), dtype=dtype)

    def load(self, weights):
        """Our tensors: matrices are transposed, and PyTorch's second bias of a layer is held at 0."""
        with torch.no_grad():
            for layer in range(self.lstm.num_layers):
                for theirs, ours in (("weight_ih", "input"), ("weight_hh", "recurrent"), ("bias_ih", "bias")):
                    getattr(self.lstm, f"{theirs}_l{layer}").copy_(weights[f"layers.{layer}.{ours}"].t())
                second = getattr(self.lstm, f"bias_hh_l{layer}")
                second.zero_()
                second.requires_grad_(False)
            names = [name for name in ("logits", "means", "log_stddevs", "classes") if f"heads.{name}.weight" in weights]
            self.heads.weight.copy_(torch.cat([weights[f"heads.{name}.weight"] for name in names], 1).t())
            self.heads.bias.copy_(torch.cat([weights[f"heads.{name}.bias"] for name in names]))
        return self

    def gradients(self):
        """Gradients by our names, in our shapes."""
        found = {}
        for layer in range(self.lstm.num_layers):
            for theirs, ours in (("weight_ih", "input"), ("weight_hh", "recurrent"), ("bias_ih", "bias")):
                found[f"layers.{layer}.{ours}"] = getattr(self.lstm, f"{theirs}_l{layer}").grad.t()
        names = [(name, width) for name, width in zip(("logits", "means", "log_stddevs", "classes"), self.parts) if width]
        widths = [width for _, width in names]
        for (name, _), weight, bias in zip(names, self.heads.weight.grad.split(widths), self.heads.bias.grad.split(widths)):
            found[f"heads.{name}.weight"], found[f"heads.{name}.bias"] = weight.t(), bias
        return found

    def forward(self, inputs):
        """Output rows of a batch, in the order of its rows."""
        hidden, _ = self.lstm(inputs)
        hidden = hidden.data if isinstance(hidden, torch.nn.utils.rnn.PackedSequence) else hidden.flatten(0, 1)
        return self.heads(hidden)

    def loss(self, outputs, batch):
        """Mean over the rows of -ln p(targets, classes)."""
        components, continuous = self.sizes["components"], self.sizes["continuous"]
        logits, means, log_stddevs, labelled = outputs.split(self.parts, 1)
        log_stddevs = log_stddevs.view(-1, components, continuous).clamp(*LOG_STDDEV_LIMITS)
        standard = (batch.targets.unsqueeze(1) - means.view(-1, components, continuous)) * torch.exp(-log_stddevs)
        terms = 0.5 * standard.square() + log_stddevs
        joint = log_softmax(logits, 1) - (terms * batch.mask.unsqueeze(1)).sum(2)
        first, labelled = 0, labelled.view(-1, components, sum(self.sizes["classes"]))
        for kind, count in enumerate(self.sizes["classes"]):
            chosen = batch.classes[:, kind].view(-1, 1, 1).expand(-1, components, 1)
            joint = joint + log_softmax(labelled[:, :, first : first + count], 2).gather(2, chosen).squeeze(2)
            first += count
        return (HALF_LOG_TAU * batch.mask.sum(1) - torch.logsumexp(joint, 1)).mean()


class Batch:
    """Sequences packed by time step, longest first; where all are equally long, as one dense array, which PyTorch takes as well."""

    def __init__(self, data, indices):
        steps = data["steps"][indices]
        steps, order = steps.sort(descending=True, stable=True)
        starts = data["starts"][indices[order]]
        sizes = [int((steps > step).sum()) for step in range(int(steps[0]))]
        rows = torch.cat([starts[:alive] + step for step, alive in enumerate(sizes)])
        observations = data["observations"][rows]
        self.rows = len(rows)
        if len(set(sizes)) == 1:
            self.inputs = observations.view(len(sizes), sizes[0], -1)
        else:
            self.inputs = torch.nn.utils.rnn.PackedSequence(observations, torch.tensor(sizes))
        self.targets, self.mask = data["targets"][rows], data["mask"][rows]
        self.classes = data["classes"][rows].long()


class Problem:
    """A folder as the bench writes it, with network and optimiser."""

    def __init__(self, folder):
        with open(f"{folder}/problem.json") as file:
            self.sizes = json.load(file)
        self.weights = read_tensors(f"{folder}/weights.safetensors")
        self.data = read_tensors(f"{folder}/data.safetensors")
        self.data["starts"] = self.data["steps"].cumsum(0) - self.data["steps"]
        self.network = Prior(self.sizes).load(self.weights)
        trained = [parameter for parameter in self.network.parameters() if parameter.requires_grad]
        # The fastest of PyTorch's implementations on a CPU.
        self.adam = torch.optim.Adam(trained, lr=self.sizes["learning_rate"], eps=1e-8, fused=True)
        self.trained = trained

    def epoch(self, epoch, loss):
        total, rows = 0.0, 0
        cpu, wall = time.process_time(), time.perf_counter()
        for indices in self.data["orders"][epoch - 1].split(self.sizes["batch"]):
            batch = Batch(self.data, indices)
            self.adam.zero_grad()
            outputs = self.network(batch.inputs)
            value = self.network.loss(outputs, batch) if loss == "mixture" else outputs.square().mean()
            value.backward()
            if self.sizes["clip_norm"] is not None:
                torch.nn.utils.clip_grad_norm_(self.trained, self.sizes["clip_norm"])
            self.adam.step()
            total, rows = total + value.item() * batch.rows, rows + batch.rows
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return {"cpu_s": cpu, "wall_s": wall, "training_nll": total / rows + self.sizes["training_offset"]}

    @torch.no_grad()
    def held_out(self):
        total, rows = 0.0, 0
        cpu, wall = time.process_time(), time.perf_counter()
        for indices in torch.arange(self.sizes["training"], len(self.data["steps"])).split(256):
            batch = Batch(self.data, indices)
            total += self.network.loss(self.network(batch.inputs), batch).item() * batch.rows
            rows += batch.rows
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return {"cpu_s": cpu, "wall_s": wall, "nll": total / rows + self.sizes["held_out_offset"]}

    def gradient(self, count, ours):
        """Of the first weights, whatever was trained since."""
        ours = read_tensors(ours)
        dtype = next(iter(ours.values())).dtype
        data = {name: values.to(dtype) if values.is_floating_point() else values for name, values in self.data.items()}
        network = Prior(self.sizes, dtype).load({name: values.to(dtype) for name, values in self.weights.items()})
        batch = Batch(data, torch.arange(count))
        loss = network.loss(network(batch.inputs), batch)
        loss.backward()
        worst = {}
        for name, theirs in network.gradients().items():
            worst[name] = ((ours[name] - theirs).abs().max() / theirs.abs().max()).item()
        name = max(worst, key=worst.get)
        return {"loss": loss.item(), "gradient_difference": worst[name], "tensor": name}

    @torch.inference_mode()
    def outputs(self, ours):
        ours = read_tensors(ours)
        network = Prior(self.sizes).load(self.weights)
        outputs = network(ours["observations"].unsqueeze(1))
        return {"difference": (outputs - ours["outputs"]).abs().max().item(), "largest": outputs.abs().max().item()}


class Step(torch.nn.Module):
    """One observation in original units in, one mixture in original units out, with the state of the episode; by LSTM or by cells."""

    def __init__(self, problem, cells, mixture):
        super().__init__()
        network, sizes = Prior(problem.sizes).load(problem.weights), problem.sizes
        self.lstm, self.heads, self.parts = network.lstm, network.heads, network.parts
        self.components, self.continuous, self.classes = sizes["components"], sizes["continuous"], sizes["classes"]
        self.mixture, self.cells = mixture, None
        scales = torch.tensor(sizes["observation_scales"])
        self.register_buffer("means", scales[:, 0])
        self.register_buffer("stddevs", scales[:, 1])
        scales = torch.tensor(sizes["continuous_scales"])
        self.register_buffer("target_means", scales[:, 0])
        self.register_buffer("target_stddevs", scales[:, 1])
        if cells:
            self.cells = torch.nn.ModuleList()
            for layer in range(self.lstm.num_layers):
                cell = torch.nn.LSTMCell(sizes["observations"] if layer == 0 else sizes["hidden"][0], sizes["hidden"][0])
                for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh"):
                    getattr(cell, name).data.copy_(getattr(self.lstm, f"{name}_l{layer}").data)
                self.cells.append(cell)

    def forward(self, observation, hidden, cell):
        values = torch.asinh((observation - self.means) / self.stddevs)
        if self.cells is None:
            top, (hidden, cell) = self.lstm(values.unsqueeze(0), (hidden, cell))
        else:
            top, hiddens, memories = values.unsqueeze(0), [], []
            for layer, unit in enumerate(self.cells):
                top, memory = unit(top, (hidden[layer].unsqueeze(0), cell[layer].unsqueeze(0)))
                hiddens.append(top)
                memories.append(memory)
            hidden, cell = torch.cat(hiddens), torch.cat(memories)
        outputs = self.heads(top)
        if not self.mixture:
            return outputs, hidden, cell
        logits, means, log_stddevs, labelled = outputs.view(-1).split(self.parts)
        means = means.view(self.components, self.continuous) * self.target_stddevs + self.target_means
        stddevs = log_stddevs.view(self.components, self.continuous).clamp(*LOG_STDDEV_LIMITS).exp() * self.target_stddevs
        classes = [log_softmax(part, 1) for part in labelled.view(self.components, -1).split(self.classes, 1)]
        return (log_softmax(logits, 0), means, stddevs, *classes), hidden, cell


@torch.inference_mode()
def time_steps(problem, calls, compiled):
    start = torch.zeros(len(problem.sizes["hidden"]), problem.sizes["hidden"][0])
    observation = problem.data["observations"][0].clone()
    variants = {
        "lstm": Step(problem, False, True),
        "lstm_without_mixture": Step(problem, False, False),
        "cells": Step(problem, True, True),
        "cells_without_mixture": Step(problem, True, False),
    }
    variants = {name: variant.eval() for name, variant in variants.items()}
    traced = torch.jit.trace(variants["cells"], (observation, start, start), check_trace=False)
    variants["cells_jit"] = torch.jit.freeze(traced)
    if compiled:
        variants["cells_compiled"] = torch.compile(variants["cells"])
    times, expected = {}, None
    for name, variant in variants.items():
        hidden, cell = start, start
        for _ in range(20):
            result, hidden, cell = variant(observation, hidden, cell)
        if expected is None:
            expected = hidden.clone()
        elif not torch.allclose(hidden, expected, atol=1e-5):
            raise AssertionError(f"{name}: another state than the LSTM by {(hidden - expected).abs().max().item()}")
        begin = time.process_time()
        for _ in range(calls):
            result, hidden, cell = variant(observation, hidden, cell)
        times[name] = 1e6 * (time.process_time() - begin) / calls
    return times


def reference(path):
    """A small network with unequal lengths and masks; numbers are multiples of 1/256, so that f32 holds them exactly."""
    sizes = {"observations": 4, "continuous": 3, "classes": [3, 2], "hidden": [6, 6], "components": 3, "batch": 5}
    generator = torch.Generator().manual_seed(1)
    draw = lambda *shape, scale: torch.round(torch.randn(*shape, generator=generator) * scale * 256).double() / 256
    shapes, labels = {}, sum(sizes["classes"])
    for layer, inputs in enumerate([4, 6]):
        shapes |= {f"layers.{layer}.input": (inputs, 24), f"layers.{layer}.recurrent": (6, 24), f"layers.{layer}.bias": (24,)}
    for name, width in (("logits", 3), ("means", 9), ("log_stddevs", 9), ("classes", 3 * labels)):
        shapes |= {f"heads.{name}.weight": (6, width), f"heads.{name}.bias": (width,)}
    weights = {name: draw(*shape, scale=0.4) for name, shape in shapes.items()}
    # Two scales beyond their limits, where the gradient stops.
    weights["heads.log_stddevs.bias"][0], weights["heads.log_stddevs.bias"][4] = -7.0, 5.0
    steps = torch.tensor([4, 1, 6, 6, 3])
    rows = int(steps.sum())
    data = {
        "steps": steps,
        "starts": steps.cumsum(0) - steps,
        "observations": draw(rows, 4, scale=1.0),
        "targets": draw(rows, 3, scale=1.0),
        "mask": (torch.rand(rows, 3, generator=generator) > 0.25).double(),
        "classes": torch.stack([torch.randint(count, (rows,), generator=generator) for count in sizes["classes"]], 1),
    }
    data["targets"] = data["targets"] * data["mask"] + 0.0
    network = Prior(sizes, torch.float64).load(weights)
    batch = Batch(data, torch.arange(len(steps)))
    loss = network.loss(network(batch.inputs), batch)
    loss.backward()
    flat = lambda values: values.reshape(-1).tolist()
    result = {
        "written_by": f"tests/peers/pytorch_prior.py --reference, PyTorch {torch.__version__}",
        "sizes": {name: value for name, value in sizes.items() if name != "batch"},
        "sequences": [
            {
                "steps": count,
                "observations": flat(data["observations"][first : first + count]),
                "targets": flat(data["targets"][first : first + count]),
                "mask": flat(data["mask"][first : first + count]),
                "classes": flat(data["classes"][first : first + count]),
            }
            for first, count in zip(data["starts"].tolist(), steps.tolist())
        ],
        "weights": {name: flat(values) for name, values in weights.items()},
        "loss": loss.item(),
        "gradient": {name: flat(values) for name, values in network.gradients().items()},
    }
    with open(path, "w") as file:
        json.dump(result, file, indent=None, separators=(",", ":"))
        file.write("\n")


def optimiser(path):
    """Forty steps of Adam and AdamW in f64, with rates that fall and gradients of very different sizes."""
    generator = torch.Generator().manual_seed(2)
    rates = [0.01 * (1.0 - step / 50) for step in range(40)]
    start = torch.round(torch.randn(6, generator=generator) * 256).double() / 256
    scales = torch.tensor([1.0, 1e-3, 30.0, 0.1, 1.0, 1.0], dtype=torch.float64)
    # Exact in f32, so that both begin with the same numbers.
    gradients = [(torch.randn(6, generator=generator).double() * scales).float().double() for _ in rates]
    decay, paths = 0.1, {}
    for name, kind, options in (("adam", torch.optim.Adam, {}), ("adamw", torch.optim.AdamW, {"weight_decay": decay})):
        weights = start.clone().requires_grad_()
        adam = kind([weights], lr=rates[0], eps=1e-8, **options)
        paths[name] = []
        for rate, gradient in zip(rates, gradients):
            adam.param_groups[0]["lr"] = rate
            weights.grad = gradient.clone()
            adam.step()
            paths[name].append(weights.detach().tolist())
    result = {
        "written_by": f"tests/peers/pytorch_prior.py --optimiser, PyTorch {torch.__version__}",
        "rates": rates,
        "weight_decay": decay,
        "start": start.tolist(),
        "gradients": [gradient.tolist() for gradient in gradients],
        **paths,
    }
    with open(path, "w") as file:
        json.dump(result, file, indent=None, separators=(",", ":"))
        file.write("\n")


def answer(problem, request):
    what = request.pop("do")
    if what == "open":
        # As ours do, gradients too small to matter become 0: left subnormal they slow an epoch to half its speed or less.
        torch.set_flush_denormal(True)
        torch.set_num_threads(request["threads"])
        problem = Problem(request["folder"])
        return problem, {"threads": torch.get_num_threads()}
    if what == "step":
        return problem, time_steps(problem, request["calls"], request["compile"])
    if what in ("epoch", "held_out", "gradient", "outputs"):
        return problem, getattr(problem, what)(**request)
    raise ValueError(f"no such request: {what}")


def main():
    if sys.argv[1:2] == ["--reference"]:
        torch.set_num_threads(1)
        reference(sys.argv[2])
        return
    if sys.argv[1:2] == ["--optimiser"]:
        optimiser(sys.argv[2])
        return
    print(json.dumps({"torch": torch.__version__, "numpy": numpy.__version__, "python": sys.version.split()[0]}), flush=True)
    problem = None
    for line in sys.stdin:
        problem, result = answer(problem, json.loads(line))
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
