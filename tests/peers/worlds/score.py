#!/usr/bin/env python3
"""Scores the answers of `diagnose` against the truth of logs that make_logs.py wrote.

    python tests/peers/worlds/score.py DIR [DIR…] ANSWERS [--run target/release/diagnose] [--jobs 2] [--out FILE.md]

Each DIR holds log-NNN and truth/log-NNN.json; the answer to DIR/log-NNN lies in ANSWERS/NAME-OF-DIR/log-NNN/report.json. With `--run` those that
lack are made first, each from its log alone. Shares come with 95 % Wilson intervals; logs without an answer are left out and counted.

What counts: a name is right if it is hidden; an effect that an engine's variant has of itself (`natural` in the truth) and, where clocks are
skewed, a delay are neither right nor wrong.
"""

import argparse
import concurrent.futures
import json
import math
import pathlib
import statistics
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from mujoco_score import share  # noqa: E402

SURE = 0.9
SKEWED_S = 0.003
DELAYS = {"pose_delay", "actuation_delay"}


def load(folders, answers):
    """(truth, report or None) of every log."""
    out = []
    for folder in folders:
        for path in sorted((folder / "truth").glob("log-*.json")):
            report = answers / folder.name / path.stem / "report.json"
            out.append((json.loads(path.read_text()) | {"folder": folder.name}, json.loads(report.read_text()) if report.exists() else None))
    return out


def answer(program, folder, name, answers):
    out = answers / folder.name / name
    if (out / "report.json").exists():
        return
    done = subprocess.run([program, "--measured", folder / name, "--out", out, "--threads", "1"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.stderr.write(f"{folder.name}/{name}: exit {done.returncode}: {done.stderr.strip()}\n")


def inside(truth, fitted):
    """Of each parameter that was fitted, whether its 90 % interval holds the true value."""
    hits, true = [], dict(truth["parameters"])
    found = {p.get("key", p["name"]): p for p in fitted["parameters"]}
    if truth["name"] == "anisotropic_friction" and {"amplitude", "axis_rad"} <= found.keys():
        # a at φ is −a at φ ± π/2, and φ is φ + π.
        if true["amplitude"] * found["amplitude"]["value"] < 0:
            true["amplitude"], true["axis_rad"] = -true["amplitude"], true["axis_rad"] + math.pi / 2
        true["axis_rad"] += round((found["axis_rad"]["value"] - true["axis_rad"]) / math.pi) * math.pi
    for key, value in true.items():
        interval = found.get(key, {}).get("interval90")
        if interval and not isinstance(value, (str, bool)):
            hits.append(interval[0] <= value <= interval[1])
    return hits


def judge(truth, report):
    """One row of figures; None where a figure does not apply."""
    hidden = {e["name"]: e for e in truth["effects"]}
    verdict = report["verdict"]
    named = [e for e in report["effects"] if verdict == "effect"]
    neutral = set(truth.get("natural", ())) | (DELAYS if abs(truth["skew_s"]) > SKEWED_S else set())
    counted = [e for e in named if e["name"] in hidden or e["name"] not in neutral]
    row = dict.fromkeys(("first", "all", "none_ok", "alarm", "outside_ok", "lost", "missed"))
    row["verdict"] = verdict
    row["right"] = [(e["confidence"], e["name"] in hidden) for e in counted]
    row["sure_wrong"] = any(c >= SURE and not right for c, right in row["right"])
    row["covered"] = [hit for e in counted if e["name"] in hidden for hit in inside(hidden[e["name"]], e)]
    row["rollouts"], row["seconds"] = report["rollouts"], report["seconds"]
    if truth["kind"] == "none":
        row["none_ok"], row["alarm"] = verdict == "none" or (verdict == "effect" and not counted), bool(counted)
    elif truth["kind"] == "outside":
        row["outside_ok"] = verdict == "unknown"
    else:
        row["first"] = bool(counted) and counted[0]["name"] in hidden
        row["all"] = set(hidden) <= {e["name"] for e in counted}
        row["lost"], row["missed"] = verdict == "unknown", verdict == "none"
    return row


def by_gap(folders, judged_by):
    """Logs that hide nothing, by how far another engine is from them: the largest mean square of a channel (gap.py)."""
    bins = {"at most 2": [], "2 to 20": [], "20 to 200": [], "above 200": []}
    for folder in folders:
        path = folder / "truth" / "gap.json"
        for name, gaps in json.loads(path.read_text()).items() if path.exists() else ():
            row, most = judged_by.get((folder.name, name)), max(gaps.values())
            if row:
                list(bins.values())[sum(most > edge for edge in (2, 20, 200))].append(row)
    lines = ["| another engine is apart by (noise variances) | logs | called none | called an effect |", "|---|---|---|---|"]
    lines += [f"| {name} | {len(rows)} | {share(having(rows, 'none_ok'))} | {share(having(rows, 'alarm'))} |" for name, rows in bins.items()]
    return "\n".join(lines)


def having(rows, key):
    return [r[key] for r in rows if r[key] is not None]


HEADS = ["logs", "hidden effect named first", "all hidden named", "effect called unknown", "effect called none", "wrong and sure (≥ 0.9)",
         "none called none", "none called an effect", "outside called unknown", "90 % intervals cover", "rollouts, median", "seconds, median"]


def cells(rows):
    middle = lambda key: f"{statistics.median(r[key] for r in rows):.0f}"
    return [str(len(rows)), *(share(having(rows, k)) for k in ("first", "all", "lost", "missed", "sure_wrong", "none_ok", "alarm", "outside_ok")),
            share([hit for r in rows for hit in r["covered"]]), middle("rollouts"), middle("seconds")]


def table(groups):
    """Figures by group, a group a column."""
    groups = [(name, rows) for name, rows in groups if rows]
    columns = [cells(rows) for _, rows in groups]
    lines = ["| | " + " | ".join(name for name, _ in groups) + " |", "|---" * (len(groups) + 1) + "|"]
    return "\n".join(lines + [f"| {head} | " + " | ".join(c[i] for c in columns) + " |" for i, head in enumerate(HEADS)])


def calibration(rows):
    """Reliability of the confidence of what was named, and its expected error (Naeini, Cooper and Hauskrecht 2015)."""
    pairs = [pair for r in rows for pair in r["right"]]
    lines = ["| confidence | named | mean confidence | right |", "|---|---|---|---|"]
    error, edges = 0.0, [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0000001]
    for low, high in zip(edges, edges[1:]):
        inside_bin = [(c, ok) for c, ok in pairs if low <= c < high]
        if inside_bin:
            mean, hits = sum(c for c, _ in inside_bin) / len(inside_bin), [ok for _, ok in inside_bin]
            error += abs(mean - sum(hits) / len(hits)) * len(hits) / len(pairs)
            lines.append(f"| {low:.2f}–{min(high, 1):.2f} | {len(hits)} | {mean:.3f} | {share(hits)} |")
    return "\n".join(lines + ["", f"Expected calibration error: {error:.3f} over {len(pairs)} names." if pairs else "Nothing was named."])


def by_effect(judged):
    names = sorted({e["name"] for t, _ in judged for e in t["effects"]})
    lines = ["| hidden | logs | named first | called unknown | called none |", "|---|---|---|---|---|"]
    for name in names:
        rows = [row for t, row in judged if [e["name"] for e in t["effects"]] == [name]]
        if rows:
            lines.append(f"| {name} | {len(rows)} | " + " | ".join(f"{sum(having(rows, k))}" for k in ("first", "lost", "missed")) + " |")
    return "\n".join(lines)


def report(folders, pairs):
    judged = [(t, judge(t, r)) for t, r in pairs if r]
    judged_by = {(t["folder"], t["name"]): row for t, row in judged}
    pick = lambda keep: [row for t, row in judged if keep(t)]
    engines = sorted({t["engine"] for t, _ in judged})
    variants = sorted({(t["engine"], t["variant"]) for t, _ in judged})
    parts = [f"{len(judged)} logs with an answer, {len(pairs) - len(judged)} without.",
             "## By engine", table([("all", pick(lambda t: True))] + [(e, pick(lambda t, e=e: t["engine"] == e)) for e in engines]),
             "## By variant", table([(f"{e} {v}", pick(lambda t, e=e, v=v: (t["engine"], t["variant"]) == (e, v))) for e, v in variants]),
             "## By kind of log",
             table([("designed", pick(lambda t: t["designed"])), ("passive", pick(lambda t: not t["designed"] and not t["tosses"])),
                    ("tosses", pick(lambda t: t["tosses"])), ("one clock", pick(lambda t: abs(t["skew_s"]) <= SKEWED_S)),
                    ("skewed clocks", pick(lambda t: abs(t["skew_s"]) > SKEWED_S)), ("rows of their own", pick(lambda t: t["own_rows"])),
                    ("noise stated", pick(lambda t: len(t["noise_stated"]) == len(t["noise"]))),
                    ("not stated", pick(lambda t: not t["noise_stated"])),
                    ("in the catalogue's range", pick(lambda t: bool(t["effects"]) and all(e["in_range"] for e in t["effects"])))]),
             "## Nothing hidden, by what engines have apart", by_gap(folders, judged_by), "## By effect", by_effect(judged), "## Confidence", calibration([row for _, row in judged])]
    return "\n\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=pathlib.Path, nargs="+", help="folders of logs, and last the folder of answers")
    parser.add_argument("--run", help="the program, to answer what has no answer yet")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path)
    options = parser.parse_args()
    if len(options.folders) < 2:
        parser.error("expected folders of logs, then the folder of answers")
    *folders, answers = options.folders
    if options.run:
        logs = [(folder, path.stem) for folder in folders for path in sorted((folder / "truth").glob("log-*.json"))]
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda log: answer(options.run, *log, answers), logs))
    pairs = load(folders, answers)
    if not any(r for _, r in pairs):
        sys.stderr.write(f"{answers}: expected NAME-OF-DIR/log-NNN/report.json for the logs given, found none\n")
        return 2
    text = report(folders, pairs)
    print(text)
    if options.out:
        options.out.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
