#!/usr/bin/env python3
"""Logs of this project's own arms for `diagnose`, every other one without an effect; the truth apart from them.

    python tests/peers/worlds/arm_logs.py --robot jaco --seed 91 --logs 20 --out DIR

DIR/rapier-ROBOT-seedN is as `make_logs.py` writes it. Run it in the repository, after `cargo build --release`.
"""

import argparse
import pathlib
import random
import subprocess


def draw(rng):
    """An effect as `--set effects.truth=[…]` takes it."""
    between = rng.uniform

    def either(low, high):
        return rng.choice([-1, 1]) * rng.uniform(low, high)

    kinds = [
        lambda: f"viscous_damping={{coefficient_nspm={between(0.5, 2):.3f}}}",
        lambda: f"table_tilt={{slope_x_rad={either(0.005, 0.03):.4f},slope_y_rad={either(0.005, 0.03):.4f}}}",
        lambda: f"constant_force={{force_x_n={either(0.1, 0.5):.3f},force_y_n={either(0.1, 0.5):.3f}}}",
        lambda: f"force_bias={{bias_x_n={either(0.2, 1):.3f},bias_y_n={either(0.2, 1):.3f},bias_z_n={either(0.2, 1):.3f}}}",
        lambda: f"pose_offset={{offset_x_m={either(0.002, 0.012):.4f},offset_y_m={either(0.002, 0.012):.4f},offset_z_m={0.0:.4f}}}",
        lambda: f"pose_scale={{scale={1 + either(0.02, 0.06):.4f}}}",
        lambda: f"actuation_delay={{delay_secs={between(0.02, 0.08):.3f}}}",
        lambda: f"force_gain={{gain={1 + either(0.08, 0.25):.3f}}}",
    ]
    return kinds[rng.randrange(len(kinds))]()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=["sawyer", "jaco"], default="jaco")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--program", default="target/release/record-log")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    options = parser.parse_args()
    folder = options.out / f"rapier-{options.robot}-seed{options.seed}"
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    for index in range(options.logs):
        seed = 1000 * options.seed + index
        hidden = f"{{{draw(random.Random(seed))}}}" if index % 2 else ""
        domain, actions = ["D1", "D2", "D3"][index // 2 % 3], ["designed", "passive"][index // 6 % 2]
        name = f"log-{index:03d}"
        places = ["--out", folder / name, "--truth", folder / "truth" / f"{name}.json"]
        what = ["--domain", domain, "--robot", options.robot, "--actions", actions, "--seed", str(seed)]
        # What `diagnose` is not told, the scenario does not know either.
        what += ["--set", "effects.model=[]"]
        subprocess.run([options.program, *what, "--set", f"effects.truth=[{hidden}]", *places], check=True)


if __name__ == "__main__":
    main()
