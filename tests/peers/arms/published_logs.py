"""Logs of joints from recordings of real arms that others have published. None is shipped: clone the repository first.

    python published_logs.py tx40 CLONE --out DIR       github.com/thanhndv212/figaroh-examples, Staubli TX40, 9 s at 5 kHz
    python published_logs.py tiago CLONE --out DIR      the same repository, TIAGo's arm, 59 s at 100 Hz
    python published_logs.py airbot CLONE --out DIR     github.com/liuyurong129/figaroh_kinova, AIRBOT Play, 30 s at 100 Hz
    python published_logs.py panda CLONE --out DIR      github.com/marcocognetti/FrankaEmikaPandaDynModel, Panda, 20 s at 250 Hz, with the file of
                                                        example-robot-data (pip install example-robot-data), and of pybullet_data

Constants are those of the repositories' own scripts and settings: gear ratios, the coupled wrist of the TX40, motor constants.
"""

from __future__ import annotations

import argparse
import os
import shutil

import numpy as np


def table(path: str) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", skip_header=1)


def write(folder: str, urdf: str, joints: list[str], tip: str | None, period_secs: float, time_secs: np.ndarray,
          position: np.ndarray, torque: np.ndarray, velocity: np.ndarray | None = None) -> None:
    os.makedirs(folder, exist_ok=True)
    shutil.copyfile(urdf, os.path.join(folder, "arm.urdf"))
    names = ", ".join(f'"{name}"' for name in joints)
    text = f'version = 1\nrobot = "arm.urdf"\njoints = [{names}]\nperiod_secs = {period_secs:g}\n'
    if tip:
        text += f'tip_link = "{tip}"\n'
    with open(os.path.join(folder, "log.toml"), "w", encoding="utf-8") as file:
        file.write(text)
    kinds = [("joint_{}_rad", position), ("joint_{}_rps", velocity), ("joint_torque_{}_nm", torque)]
    kinds = [(name, values) for name, values in kinds if values is not None]
    header = ["time_secs"] + [name.format(i) for name, values in kinds for i in range(values.shape[1])]
    rows = np.hstack([time_secs[:, None]] + [values for _, values in kinds])
    with open(os.path.join(folder, "samples.csv"), "w", encoding="ascii") as file:
        file.write(",".join(header) + "\n")
        for row in rows:
            file.write(",".join("" if np.isnan(value) else f"{value:.9g}" for value in row) + "\n")


def tx40(clone: str, out: str) -> None:
    """Motor angles and currents; a motor of the wrist turns joints 5 and 6."""
    folder = os.path.join(clone, "examples/staubli_TX40")
    motor, current = (table(f"{folder}/data/{name}.csv") for name in ("pos_read_data", "curr_data"))
    ratio = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    turns, torques = np.diag(ratio), np.diag(ratio)
    turns[5, 4] = torques[4, 5] = 32.0
    position = motor @ np.linalg.inv(turns).T + np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
    write(out, f"{folder}/urdf/tx40_mdh_modified.urdf", [f"joint_{i}" for i in range(1, 7)], "tool0", 0.0002,
          np.arange(len(motor)) * 0.0002, position, current @ torques.T)


def tiago(clone: str, out: str) -> None:
    """The arm without a hand. The efforts of joints 5 to 7 are next to nothing and never fit a motion: left out."""
    folder = os.path.join(clone, "examples/tiago")
    data = [table(f"{folder}/data/identification/dynamic/tiago_{name}.csv") for name in ("position", "velocity", "effort")]
    rows = slice(921, 6791)  # as in identification.py
    time_secs = data[0][rows, 0]
    position, velocity, effort = (values[rows, 2:] for values in data)  # without the torso
    motor = np.array([0.136, 0.136, -0.087, -0.087]) * 100.0
    torque = np.full_like(effort, np.nan)
    torque[:, :4] = effort[:, :4] * motor
    write(out, f"{folder}/urdf/tiago_no_hand.urdf", [f"arm_{i}_joint" for i in range(1, 8)], None, 0.01, time_secs, position,
          torque, velocity)


def airbot(clone: str, out: str) -> None:
    """Three logs: two motions without a load, and one of them with a load of which the mass is not published."""
    folder = os.path.join(clone, "examples/airbot_play/data")
    for name, motion, ending in [("chirp", "chirp_motion", ""), ("chirp-loaded", "chirp_motion", "_loaded"),
                                 ("trapezoidal", "trapezoidal_motion", "")]:
        position, torque = (table(f"{folder}/identification/{motion}/identification_{kind}_real{ending}.csv")[:, :6]
                            for kind in ("q", "tau"))
        rows = min(len(position), len(torque))
        write(os.path.join(out, name), f"{folder}/urdf/airbot_play_v3_0_gripper.urdf", [f"joint{i}" for i in range(1, 7)],
              None, 0.01, np.arange(rows) * 0.01, position[:rows], torque[:rows])


def panda(clone: str, out: str) -> None:
    """Every fourth row of what the authors logged at 1 kHz, with their uneven stamps."""
    import arm_models
    import pybullet_data

    folder = os.path.join(clone, "matlab/data/Exciting_Traj/Trajectory_1/rbt_log")
    time_secs, position, velocity, torque = (np.loadtxt(f"{folder}/exciting_traj_{name}.txt")
                                             for name in ("time", "positions", "velocity", "torques"))
    position, velocity, torque = (values.reshape(-1, 7)[::4] for values in (position, velocity, torque))
    files = {"example-robot-data": arm_models.file_of("panda"),
             "pybullet_data": os.path.join(pybullet_data.getDataPath(), "franka_panda/panda.urdf")}
    for name, urdf in files.items():
        write(os.path.join(out, name), urdf, [f"panda_joint{i}" for i in range(1, 8)], None, 0.004, time_secs[::4], position,
              torque, velocity)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arm", choices=["tx40", "tiago", "airbot", "panda"])
    parser.add_argument("clone", help="folder of the cloned repository")
    parser.add_argument("--out", required=True)
    options = parser.parse_args()
    {"tx40": tx40, "tiago": tiago, "airbot": airbot, "panda": panda}[options.arm](options.clone, options.out)


if __name__ == "__main__":
    main()
