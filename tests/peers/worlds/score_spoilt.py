#!/usr/bin/env python3
"""What `diagnose` says of good logs that were spoilt: whether it is surely wrong without a warning.

    cargo xtask bench log-check LOG LOG … --write runs/spoilt
    for log in runs/spoilt/* LOG LOG …; do cargo xtask diagnose --measured $log --out runs/answers/$(basename $log); done
    python tests/peers/worlds/score_spoilt.py runs/spoilt runs/answers LOG LOG …

The logs hide nothing, so that every effect that is named is wrong, but for those that are the fault itself (`SAME`). A log without an answer, such as one that is
refused, is counted apart. The logs as they were, where they are named, are a row of their own.
"""

import json
import pathlib
import re
import sys

# A fault, and names that say the same.
SAME = {
    "times 1 % long": {"time_base"},
    "pose of the lower face": {"pose_offset"},
    "the largest 3 % of forces cut off": {"force_saturation"},
    "forces in kilograms-force": {"force_gain"},
    "forces in millinewtons": {"force_gain"},
    "times of arrival": {"pose_delay", "actuation_delay"},
}
SURE = 0.9


def fault_of(log):
    """As `log.toml` says in its first line."""
    found = re.search(r"Spoilt: (.+)", (log / "log.toml").read_text())
    return found.group(1).strip() if found else "as they were"


def main():
    logs, answers = map(pathlib.Path, sys.argv[1:3])
    rows = {}
    for log in [*map(pathlib.Path, sys.argv[3:]), *sorted(path for path in logs.iterdir() if path.is_dir())]:
        fault = fault_of(log)
        row = rows.setdefault(fault, {"logs": 0, "no_answer": 0, "warned": 0, "effect": 0, "sure": 0, "silent": []})
        row["logs"] += 1
        report = answers / log.name / "report.json"
        if not report.exists():
            row["no_answer"] += 1
            continue
        answer = json.loads(report.read_text())
        best = max(answer["probabilities"]["effects"], key=lambda effect: effect[1], default=None)
        wrong = answer["verdict"] == "effect" and best is not None and best[0] not in SAME.get(fault, ())
        sure = wrong and best[1] >= SURE
        row["warned"] += bool(answer["warnings"])
        row["effect"] += wrong
        row["sure"] += sure
        if sure and not answer["warnings"]:
            row["silent"].append(f"{log.name}: {best[0]} {best[1]:.2f}")
    print("| fault | logs | no answer | warned of | another effect named | of these 0.9 sure | of these without a warning |")
    print("|---|---|---|---|---|---|---|")
    for fault, row in rows.items():
        print(f"| {fault} | {row['logs']} | {row['no_answer']} | {row['warned']} | {row['effect']} | {row['sure']} | {len(row['silent'])} |")
    for fault, row in rows.items():
        for line in row["silent"]:
            print(f"\n{fault}, {line}")


if __name__ == "__main__":
    main()
