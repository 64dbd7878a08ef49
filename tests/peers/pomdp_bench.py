"""Speed of pomdp-py's POMCP on RockSample(7, 8): simulations per second of CPU time, one JSON object.

python tests/peers/pomdp_bench.py [--seconds 10]; exits with status 3 and says what is missing where pomdp-py is not installed.
Preferred actions of the package's own problems are not used: it ships none; rollouts are uniform over legal actions, 90 deep.
"""

import argparse
import contextlib
import importlib.metadata
import io
import json
import random
import sys
import time

try:
    import pomdp_py
except ImportError:
    print("missing: pip install pomdp-py==1.3.5.1", file=sys.stderr)
    sys.exit(3)

ROCKS = [(2, 0), (0, 1), (3, 1), (6, 3), (2, 4), (3, 4), (5, 5), (1, 6)]


def rock_sample():
    from pomdp_py.problems.rocksample import rocksample_problem as rs

    locations = {place: index for index, place in enumerate(ROCKS)}
    start = (0, 3)
    kinds = tuple(rs.RockType.random() for _ in ROCKS)
    state = rs.State(start, kinds, False)
    particles = [rs.State(start, tuple(rs.RockType.random() for _ in ROCKS), False) for _ in range(1024)]
    problem = rs.RockSampleProblem(7, len(ROCKS), state, locations, pomdp_py.Particles(particles))
    return problem, 20.0


def rate(agent, exploration, seconds):
    planner = pomdp_py.POMCP(
        max_depth=90,
        discount_factor=0.95,
        num_sims=2048,
        exploration_const=exploration,
        rollout_policy=agent.policy_model,
    )
    simulations, start = 0, time.process_time()
    while time.process_time() - start < seconds:
        agent.tree = None
        planner.plan(agent)
        simulations += planner.last_num_sims
    return simulations / (time.process_time() - start)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10)
    seconds = parser.parse_args().seconds
    random.seed(1)
    with contextlib.redirect_stdout(io.StringIO()):
        problem, exploration = rock_sample()
        speed = rate(problem.agent, exploration, seconds)
    version = importlib.metadata.version("pomdp-py")
    print(json.dumps({"pomdp_py": version, "rocksample_7_8": {"simulations_per_second": speed}}))


if __name__ == "__main__":
    main()
