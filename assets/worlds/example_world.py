#!/usr/bin/env python3
"""A small world behind the protocol (docs/src/reference/world-protocol.md): a disc that goes where it is pushed.
Start from this file to bring your own robot or simulator. It needs no packages.

    cargo xtask eval --domain obstacle --robot jaco --methods heuristic --world "python3 assets/worlds/example_world.py"
"""

import json
import math
import random
import sys

CONTACT_M = 0.15  # from the tool's centre to the disc's, where they touch: the hand reaches 0.11 m ahead, the disc 0.04 m


class World:
    def __init__(self, hello):
        self.task, self.names, scene = hello["task"], hello["observation"], hello["scene"]
        self.where, self.noise_m = scene["distribution"]["object"], scene["noise"]["position_m"]
        if any(name.endswith("_rad") for name in self.names):
            raise ValueError("this example knows no joint positions, which the arm's sensors give: use --robot jaco")

    def reset(self, trial, seed):
        self.random, self.tool = random.Random(seed), list(self.task["tool_start_m"])
        draw = lambda d: min(max(self.random.gauss(d["mean"], d["stddev"]), d["low"]), d["high"])
        self.disc = [draw(self.where["x_m"]), draw(self.where["y_m"])]
        return {"trial": trial, "observation": self.observe(), "tool_m": self.tool, "has_obstacle": False}

    def act(self, step, action, move_m):
        target, before = [t + m for t, m in zip(self.tool, move_m)], list(self.disc)
        inside = all(low <= v <= high for v, (low, high) in zip(target, self.task["reach"].values()))
        if inside:
            far, self.tool = math.dist(self.tool[:2], self.disc), target
            if math.dist(target[:2], self.disc) < min(far, CONTACT_M):  # pushed, not left behind: it goes where the tool goes
                self.disc = [d + m for d, m in zip(self.disc, move_m)]
        goal = self.task["goal"]
        won = math.hypot(self.disc[0] - goal["x_m"], self.disc[1] - goal["y_m"]) <= goal["radius_m"]
        moved = math.dist(before, self.disc) > self.task["moved_threshold_m"]
        events = {"large_force": False, "out_of_reach": not inside, "object_moved": moved, "goal": won}
        return {"step": step, "observation": self.observe(), "tool_m": self.tool,
                "outcome": "terminal" if won else "continue", "events": events}

    def observe(self):
        """As many values as there are names: torques that feel nothing, the disc's noisy position, and an upright pose."""
        x, y = (v + self.random.gauss(0, self.noise_m) for v in self.disc)
        return [0.0] * (len(self.names) - 7) + [x, y, self.task["table_height_m"] + 0.045, 0.0, 0.0, 0.0, 1.0]


for line in sys.stdin:  # ends where the planner does
    (name, body), = json.loads(line).items()
    if name == "close":
        break
    try:
        if name == "hello":
            world = World(body)
            answer = {"protocol": 1, "world": "example", "version": "1", "robot": body["robot"]["name"]}
        else:
            answer = getattr(world, {"reset": "reset", "act": "act"}[name])(**body)
    except ValueError as error:
        name, answer = "error", {"message": str(error)}
    print(json.dumps({name: answer}), flush=True)
