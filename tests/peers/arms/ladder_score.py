"""Which rung of the friction ladder was named, and what it leaves beside the true one.

    python ladder_score.py LOGS ANSWERS [TABLE.csv]

LOGS is what ladder_logs.py made; ANSWERS has a folder of each log's name with the report.json of `cargo xtask diagnose`.
"""

import csv
import json
import os
import sys

RUNGS = {"joint_friction": "M1", "stribeck_friction": "M2", "load_friction": "M3", "stribeck_load_friction": "M4",
         "stribeck_directional_friction": "M5", "quadratic_load_friction": "M6"}


def main() -> None:
    logs, answers, *out = sys.argv[1:]
    with open(os.path.join(logs, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    names = {rung: name for name, rung in RUNGS.items()}
    table = {rung: {} for rung in names}
    ratios, right, lines = [], 0, []
    for log, known in sorted(truth.items()):
        path = os.path.join(answers, log, "report.json")
        if not os.path.exists(path):
            sys.exit(f"{path} is missing")
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
        effect = (report["effects"] or [None])[0]
        name = effect["name"] if effect else report["verdict"]
        said = RUNGS.get(name, name)
        row = table[known["rung"]]
        row[said] = row.get(said, 0) + 1
        right += said == known["rung"]
        left = {kind["name"]: kind["heldout_rms_nm"] for kind in effect["joints"][0].get("kinds", [])} if effect else {}
        ratio = None
        if name in left and names[known["rung"]] in left:
            ratio = left[name] / left[names[known["rung"]]]
            ratios.append(ratio)
        confidence = effect["confidence"] if effect else 0.0
        lines.append([log, known["rung"], said, f"{confidence:.3f}", "" if ratio is None else f"{ratio:.4f}"])
    if out:
        with open(out[0], "w", newline="", encoding="utf-8") as file:
            heads = ["log", "truth", "named", "confidence", "heldout_error_over_true_rungs"]
            csv.writer(file, lineterminator="\n").writerows([heads] + lines)
    said = list(names) + sorted({s for row in table.values() for s in row if s not in names})
    print("| truth | " + " | ".join(said) + " |\n|---|" + "---|" * len(said))
    for rung, row in table.items():
        print(f"| {rung} | " + " | ".join(str(row.get(s, "")) for s in said) + " |")
    within = sum(r <= 1.05 for r in ratios)
    print(f"\nright rung: {right} of {len(truth)}; held-out error at most 1.05 of the true rung's: {within} of {len(truth)} "
          f"(largest ratio {max(ratios):.3f}, {len(truth) - len(ratios)} without one)")


if __name__ == "__main__":
    main()
