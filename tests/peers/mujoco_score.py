#!/usr/bin/env python3
"""What `diagnose` says of logs that mujoco_logs.py made, against their truth.

    python tests/peers/mujoco_logs.py --out runs/mujoco-logs --all --seed 13
    python tests/peers/mujoco_score.py runs/mujoco-logs --diagnose target/release/diagnose --jobs 2

Logs without an answer are answered first (DIR/answers; the solver gets the log alone). Writes DIR/table.md and DIR/sets.csv. Shares come with 95 % Wilson
intervals. Exit status 2 for a folder without truths or a solver that fails.
"""

import argparse
import concurrent.futures
import csv
import json
import math
import pathlib
import subprocess
import sys

SURE = 0.9


def wilson(hits, of):
    """95 % Wilson score interval (Wilson 1927)."""
    z, p = 1.959963984540054, hits / of
    centre = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return max(0.0, centre - half), min(1.0, centre + half)


def share(hits):
    if not hits:
        return "–"
    low, high = wilson(sum(hits), len(hits))
    return f"{100 * sum(hits) / len(hits):.0f} % ({sum(hits)}/{len(hits)}; {100 * low:.0f}–{100 * high:.0f})"


def answer(diagnose, folder, name):
    out = folder / "answers" / name
    if not (out / "report.json").exists():
        command = [diagnose, "--measured", folder / "logs" / name, "--out", out, "--threads", "1"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{name}: diagnose ended with {done.returncode}: {done.stderr.strip()}")
    return json.loads((out / "report.json").read_text())


def inside(truth, effect):
    """Of each parameter of the truth that was fitted, whether its interval holds it."""
    hits = []
    true = dict(truth["parameters"])
    fitted = {p["key"]: p for p in effect["parameters"]}
    if effect["name"] == "anisotropic_friction" and {"amplitude", "axis_rad"} <= fitted.keys() & true.keys():
        # a at φ is −a at φ ± π/2, and φ is φ + π: the one that is meant.
        if true["amplitude"] * fitted["amplitude"]["value"] < 0:
            true["amplitude"], true["axis_rad"] = -true["amplitude"], true["axis_rad"] + math.pi / 2
        true["axis_rad"] += round((fitted["axis_rad"]["value"] - true["axis_rad"]) / math.pi) * math.pi
    for key, value in true.items():
        if key in fitted:
            low, high = fitted[key]["interval90"]
            hits.append(low <= value <= high)
    return hits


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--diagnose", default="target/release/diagnose")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    truths = [json.loads(path.read_text()) for path in sorted((arguments.folder / "truth").glob("*.json"))]
    if not truths:
        sys.stderr.write(f"{arguments.folder}/truth: expected files of truths, found none\n")
        return 2
    try:
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            one = lambda truth: answer(arguments.diagnose, arguments.folder, truth["name"])
            reports = list(pool.map(one, truths))
    except (OSError, RuntimeError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    first, confused, sure, alarms, unknown, lost, covered = [], [], [], [], [], [], []
    rows = []
    for truth, report in zip(truths, reports):
        hidden, verdict = truth["effect"], report["verdict"]
        names = [effect["name"] for effect in report["effects"]]
        named = names if verdict == "effect" else []
        surely = [e["name"] for e in report["effects"] if verdict == "effect" and e["confidence"] >= SURE]
        if hidden == "none":
            alarms.append(verdict != "none")
        elif hidden == "unknown":
            unknown.append(verdict == "unknown")
        else:
            first.append(named[:1] == [hidden])
            confused.append(hidden in report["confusion_set"])
            sure.append(any(name != hidden for name in surely))
            lost.append(verdict == "unknown")
            if named[:1] == [hidden]:
                covered += inside(truth, report["effects"][0])
        rows.append({
            "set": truth["name"], "hidden": truth.get("kind", hidden) if hidden == "unknown" else hidden,
            "parameters": json.dumps(truth["parameters"]), "verdict": verdict, "named": "+".join(names),
            "confidence": round(report["effects"][0]["confidence"], 4) if names else "",
            "confusion_set": "+".join(report["confusion_set"]),
            "heldout_before": round(report["heldout"]["before"], 3), "heldout_after": round(report["heldout"]["after"], 3),
            "rollouts": report["rollouts"],
        })
    most = max(report["rollouts"] for report in reports)
    lines = [
        ("hidden effect named first", share(first), "≥ 80 %"),
        ("truth in the confusion set", share(confused), ""),
        ("wrong name, first or further, with confidence ≥ 0.9", share(sure), ""),
        ("false alarm with no effect", share(alarms), "≤ 10 %"),
        ("catalogue effect called unknown", share(lost), ""),
        ("effect outside the catalogue called unknown", share(unknown), ""),
        ("90 % intervals cover", share(covered), ""),
        ("rollouts a log: most", str(most), "≤ 5000"),
    ]
    table = "| figure | MuJoCo | target |\n|---|---|---|\n" + "".join(f"| {a} | {b} | {c} |\n" for a, b, c in lines)
    (arguments.folder / "table.md").write_text(table)
    with (arguments.folder / "sets.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
