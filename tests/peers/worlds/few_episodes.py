#!/usr/bin/env python3
"""The same logs with few episodes: the first 5 to 11 of each, with the truth beside them.

    python tests/peers/worlds/few_episodes.py runs/worlds/mujoco-all-usual-seed512 --out runs/few

Log 0 keeps 5 episodes, log 1 keeps 6, and so on to 11, then again from 5. `detectable` stays that of the whole log."""

import argparse
import json
import pathlib


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=pathlib.Path, nargs="+", help="folders that make_logs.py wrote")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    options = parser.parse_args()
    for folder in options.folders:
        for log in sorted(folder.glob("log-*")):
            number = int(log.name.removeprefix("log-"))
            kept = 5 + number % 7
            out = options.out / folder.name / log.name
            out.mkdir(parents=True, exist_ok=True)
            (out / "log.toml").write_text((log / "log.toml").read_text())
            head, *rows = (log / "samples.csv").read_text().splitlines()
            rows = [row for row in rows if int(row.split(",", 1)[0]) < kept]
            (out / "samples.csv").write_text("\n".join([head, *rows]) + "\n")
            truth = json.loads((folder / "truth" / f"{log.name}.json").read_text())
            truth |= {"episodes": min(kept, truth["episodes"]), "rows": len(rows)}
            truths = options.out / folder.name / "truth"
            truths.mkdir(exist_ok=True)
            (truths / f"{log.name}.json").write_text(json.dumps(truth, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
