"""What the generators of joint logs share: a draw, and the file of what is true."""

from __future__ import annotations

import json
import os

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
