#!/usr/bin/env python3
"""Times MuJoCo's C library on the project's action and prints one JSON object.

    python tests/peers/mujoco_bench.py [--batches K] [--actions N] [--accurate]

Compiles mujoco_bench.c against the library of the installed mujoco package, into a temporary directory. For each
obstacle (none, movable, fixed), tool (ball, hand) and cone: the median thread CPU time of one action (restore, 20
control steps of 1/60 s, observation) in microseconds with 1, 2 and 10 substeps, or, with --batches K, the list of K
medians, one per batch of N actions. "object_y_m" is where the object ends. --accurate adds where it ends with the fine
settings of mujoco_scenes.py. Without mujoco or a C compiler: one line on stderr, exit status 3.
"""

import argparse
import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile

try:
    import mujoco
except ImportError:
    sys.stderr.write("missing: pip install mujoco\n")
    sys.exit(3)

HERE = os.path.dirname(os.path.abspath(__file__))
TOOL_Z_M = {"ball": 0.05, "hand": 0.06}
# The fingers lead by 0.09 m, and 0.012 m of radius; the object's face is at y = 0.025.
TOOL_Y_M = {"ball": 0.0, "hand": 0.025 - 0.102}
OBJECT = (0.08, 0.08, 0.09)
OBJECT_AT = (0.0, 0.065, 0.045)
OBSTACLE = (0.05, 0.05, 0.09)
OBSTACLE_AT = (0.03, 0.14, 0.045)
HAND = (("-0.03 0.03 0 -0.03 0.09 -0.03", 0.012), ("0.03 0.03 0 0.03 0.09 -0.03", 0.012),
        ("0 -0.03 0 0 -0.09 -0.03", 0.012))


def model(obstacle, tool, cone):
    off = 'contype="0" conaffinity="0"'
    if tool == "ball":
        geoms = f'<geom name="tool0" type="sphere" size="0.025" {off}/>'
        tools = ["tool0"]
    else:
        geoms = "".join(f'<geom name="tool{i}" type="capsule" fromto="{a}" size="{r}" {off}/>'
                        for i, (a, r) in enumerate(HAND))
        tools = [f"tool{i}" for i in range(len(HAND))]

    def box(name, size, at, mass, free):
        half = " ".join(repr(v / 2) for v in size)
        x, y, z = size
        inertia = f"{mass * (y * y + z * z) / 12!r} {mass * (x * x + z * z) / 12!r} {mass * (x * x + y * y) / 12!r}"
        # An offset of the centre of mass and simple="false": else the compiler takes shortcuts that a change of the centre
        # of mass in place would break.
        simple = ' simple="false"' if free else ""
        inertial = f'<freejoint/><inertial pos="0.001 0 0" mass="{mass}" diaginertia="{inertia}"/>' if free else ""
        return f'<body name="{name}" pos="{" ".join(map(repr, at))}"{simple}>{inertial}' \
               f'<geom name="{name}" type="box" size="{half}" {off}/></body>'

    bodies = box("object", OBJECT, OBJECT_AT, 0.5, True)
    pairs = [("table", "object", 0.4)]
    if obstacle != "none":
        bodies += box("obstacle", OBSTACLE, OBSTACLE_AT, 1.0, obstacle == "movable")
        pairs += [("table", "obstacle", 0.5)] if obstacle == "movable" else []
        pairs += [("object", "obstacle", 0.4)] + [(t, "obstacle", 0.2) for t in tools]
    pairs += [(t, "object", 0.2) for t in tools]
    pair = "".join(f'<pair geom1="{a}" geom2="{b}" condim="3" friction="{f} {f} 0 0 0"/>' for a, b, f in pairs)
    return f"""<mujoco><option cone="{cone}" gravity="0 0 -9.81"/><worldbody>
<geom name="table" type="plane" size="0 0 1" {off}/>
<body name="tool" pos="0 {TOOL_Y_M[tool]!r} {TOOL_Z_M[tool]}" gravcomp="1"><joint type="slide" axis="1 0 0"/>
<joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1e3" diaginertia="1 1 1"/>{geoms}</body>
{bodies}</worldbody><contact>{pair}</contact></mujoco>"""


def accurate(obstacle, tool):
    sys.path.insert(0, HERE)
    import mujoco_scenes as fine
    obj = fine.Body("box", OBJECT, pos=OBJECT_AT, mass=0.5, friction=0.4)
    stands = None if obstacle == "none" else \
        fine.Body("box", OBSTACLE, pos=OBSTACLE_AT, mass=1.0, friction=0.5, movable=obstacle == "movable")
    at = (0.0, TOOL_Y_M[tool], TOOL_Z_M[tool])
    return round(float(fine.simulate(fine.Scene("bench", obj, stands, tool, at, 2)).object[1]), 6)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batches", type=int, default=0, help="print the medians of this many batches")
    parser.add_argument("--actions", type=int, default=2000, help="actions per batch")
    parser.add_argument("--substeps", type=int, nargs="+", default=[1, 2, 10], help="steps of MuJoCo in a control step")
    parser.add_argument("--accurate", action="store_true", help="also simulate finely")
    args = parser.parse_args()
    compiler = shutil.which("cc")
    if compiler is None:
        sys.stderr.write("missing: cc\n")
        sys.exit(3)
    package = os.path.dirname(os.path.abspath(mujoco.__file__))
    libraries = sorted(glob.glob(os.path.join(package, "libmujoco.so.*")))
    if not libraries:
        sys.stderr.write("missing: pip install mujoco\n")
        sys.exit(3)
    out = {"mujoco": mujoco.__version__}
    with tempfile.TemporaryDirectory() as folder:
        program = os.path.join(folder, "mujoco_bench")
        subprocess.run([compiler, "-O3", "-march=native", "-I", os.path.join(package, "include"),
                        os.path.join(HERE, "mujoco_bench.c"), libraries[-1], f"-Wl,-rpath,{package}", "-lm", "-o",
                        program], check=True)
        for obstacle in ("none", "movable", "fixed"):
            out[obstacle] = {}
            for tool in ("ball", "hand"):
                entry = {"object_y_m": {}, "force_y_n": {}}
                for cone in ("pyramidal", "elliptic"):
                    path = os.path.join(folder, "model.xml")
                    with open(path, "w", encoding="ascii") as file:
                        file.write(model(obstacle, tool, cone))
                    entry[f"{cone}_us"] = {}
                    for substeps in args.substeps:
                        run = subprocess.run([program, path, obstacle, str(substeps), str(args.actions),
                                              str(max(args.batches, 1))], check=True, stdout=subprocess.PIPE, text=True, cwd=folder)
                        result = json.loads(run.stdout)
                        batch = result["batch_us"]
                        entry[f"{cone}_us"][str(substeps)] = batch if args.batches else batch[0]
                        entry["object_y_m"].setdefault(cone, {})[str(substeps)] = result["object_y_m"]
                        entry["force_y_n"].setdefault(cone, {})[str(substeps)] = result["force_y_n"]
                        for name in ("set_const_us", "reset_data_us", "restore_us"):
                            entry[name] = result[name]
                if args.accurate:
                    entry["accurate_object_y_m"] = accurate(obstacle, tool)
                out[obstacle][tool] = entry
    print(json.dumps(out))


if __name__ == "__main__":
    main()
