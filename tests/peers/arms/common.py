"""What the generators of joint logs share: a draw, and the file of what is true."""

from __future__ import annotations

import argparse
import json
import os
from typing import Callable

import numpy as np


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def read_truth(folder: str) -> dict:
    """Entries of truth.json by name of log; none where the folder is new, which is made."""
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "truth.json")
    if not os.path.exists(path):
        return {}
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def write_truth(folder: str, truth: dict) -> None:
    """Replaces truth.json as a whole."""
    path = os.path.join(folder, "truth.json")
    with open(path + ".new", "w", encoding="utf-8") as file:
        json.dump(truth, file, indent=1, sort_keys=True)
    os.replace(path + ".new", path)


def arguments(about: str, score: Callable[[str, str], None], **choices: list[str]) -> argparse.Namespace:
    """`out`, the folder for the logs, `seed`, and one of each of `choices`, the first by default; scores and ends where the command line asks for that."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", help="folder for the logs and truth.json")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--score", nargs=2, metavar=("LOGS", "ANSWERS"))
    for name, values in choices.items():
        parser.add_argument(f"--{name}", choices=values, default=values[0])
    options = parser.parse_args()
    if options.score:
        score(*options.score)
        raise SystemExit
    if not options.out:
        parser.error("expected --out or --score")
    return options
