"""What `diagnose` says of logs of bare rigs (`arm_logs.py --rig bare`), beside the truth.

    python bare_score.py LOGS ANSWERS [LOGS ANSWERS ...] [--list]

LOGS is a folder that arm_logs.py wrote, ANSWERS one with a folder of the same name for each log, which `diagnose --out` wrote.
A payload counts as named where it is among the effects, friction in a joint where any kind of it is. Gains of torque are there in all of
these logs, by up to 5 %.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys

from common import read_truth

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from mujoco_score import wilson  # noqa: E402


THERE = ("presliding", "reflected_inertia", "payload", "torque_gain")


def share(right: int, of: int) -> str:
    """A count with its 95 % interval."""
    if not of:
        return "–"
    low, high = wilson(right, of)
    return f"{right} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--list", action="store_true", help="a line for each log")
    options = parser.parse_args()
    if len(options.folders) % 2:
        parser.error("expected LOGS and ANSWERS in pairs")
    rows = []
    for logs, answers in zip(options.folders[::2], options.folders[1::2]):
        for name, entry in sorted(read_truth(logs).items()):
            path = os.path.join(answers, name, "report.json")
            if not os.path.exists(path):
                continue
            with open(path, encoding="utf-8") as file:
                report = json.load(file)
            row = {"name": name, "arm": entry["arm"], "payload": entry["effect"] == "payload", "report": report}
            row["effects"] = {}
            for effect in report["effects"]:
                joints = {joint.get("joint_name") or "" for joint in effect["joints"]}
                row["effects"][effect["name"]] = (effect["confidence"], joints)
            load = next((effect for effect in report["effects"] if effect["name"] == "payload"), None)
            row["named"] = load is not None
            if load and row["payload"]:
                mass = next(value for value in load["joints"][0]["parameters"] if value["name"] == "mass")
                row["error"] = mass["value"] / entry["parameters"]["mass_kg"] - 1
                row["holds"] = mass["interval90"][0] <= entry["parameters"]["mass_kg"] <= mass["interval90"][1]
            rub = set().union(*(joints for effect, (_, joints) in row["effects"].items() if "friction" in effect or effect == "presliding"))
            row["friction"] = (len(rub), len(entry["coulomb_nm"]))
            row["true"], row["others"] = entry["parameters"].get("mass_kg"), sorted(
                name for name in row["effects"] if "friction" not in name and name not in THERE)
            rows.append(row)
    if not rows:
        parser.error("no answers in these folders")
    if options.list:
        for row in rows:
            load = f"{row['true']:.2f} kg" if row["payload"] else "no load"
            found = f"{100 * row['error']:+.0f} % {'in' if row['holds'] else 'OUT'}" if "error" in row else "named" if row["named"] else ""
            held = row["report"]["heldout"]
            print(f"{row['name']} {row['arm']:6s} {load:8s} {found:12s} friction {row['friction'][0]}/{row['friction'][1]} "
                  f"held out {held['before']:.3g} to {held['after']:.3g} masses x{row['report']['mass_uncertainty']} others {row['others']}")
    loaded, empty = [r for r in rows if r["payload"]], [r for r in rows if not r["payload"]]
    found = [r for r in loaded if r["named"]]
    print("| | |\n|---|---|")
    print(f"| payload named where there is one | {share(len(found), len(loaded))} |")
    print(f"| payload named where there is none | {share(sum(r['named'] for r in empty), len(empty))} |")
    print(f"| error of its mass at most 10 % | {share(sum(abs(r['error']) <= 0.1 for r in found), len(loaded))} |")
    if found:
        print(f"| median error of its mass | {100 * statistics.median(abs(r['error']) for r in found):.1f} % |")
    print(f"| 90 % interval holds its mass | {share(sum(r['holds'] for r in found), len(found))} |")
    print(f"| joints with friction that are named | {share(sum(r['friction'][0] for r in rows), sum(r['friction'][1] for r in rows))} |")
    print(f"| motors' inertia named | {share(sum('reflected_inertia' in r['effects'] for r in rows), len(rows))} |")
    print(f"| logs with an effect that is not there | {share(sum(bool(r['others']) for r in rows), len(rows))} |")
    closed = [r["report"]["heldout"]["closed_fraction"] for r in rows]
    print(f"| median share of the held-out error that is gone | {100 * statistics.median(closed):.0f} % |")


if __name__ == "__main__":
    main()
