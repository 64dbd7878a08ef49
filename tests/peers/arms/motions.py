"""Reference motions: positions, velocities and accelerations at 1 kHz, one array of rows per episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arm_models import Arm

TICK_SECS = 0.001


@dataclass
class Episode:
    """Reference of one episode at 1 kHz: position [rad], velocity [rad/s], acceleration [rad/s^2], (ticks, joints)."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def ranges(arm: Arm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower and upper joint limits (at most one turn, 5 % margin) and velocity limits."""
    joints = arm.moving
    lower = np.array([-np.pi if j.kind == "continuous" else j.lower for j in joints])
    upper = np.array([np.pi if j.kind == "continuous" else j.upper for j in joints])
    middle, half = 0.5 * (lower + upper), np.minimum(0.475 * (upper - lower), 2.8)
    return middle - half, middle + half, np.array([j.velocity for j in joints])


def draw_motion(arm: Arm, kind: str, rng: np.random.Generator) -> list[Episode]:
    """Draw 1-6 episodes, 20-40 s in all, `kind` "excitation" or "pick_place"."""
    episodes = int(rng.integers(1, 7))
    seconds = rng.uniform(20.0, 40.0) / episodes
    if kind == "excitation":
        return [_excitation(arm, seconds, rng) for _ in range(episodes)]
    speed = rng.uniform(0.2, 0.6)
    travel = seconds * episodes / rng.integers(8, 21)  # mean time for one target
    return [_pick_place(arm, seconds, speed, travel, rng) for _ in range(episodes)]


def _excitation(arm: Arm, seconds: float, rng: np.random.Generator) -> Episode:
    """Fourier series of 5 harmonics, faded in over 1.5 s so that it starts at rest."""
    lower, upper, limit = ranges(arm)
    n, t = len(lower), np.arange(int(round(seconds / TICK_SECS)) + 1) * TICK_SECS
    omega = 2.0 * np.pi * rng.uniform(0.1, 0.2) * np.arange(1, 6)
    a, b = rng.normal(size=(2, 5, n)) / np.sqrt(np.arange(1, 6))[:, None]
    sine, cosine = np.sin(np.outer(t, omega)), np.cos(np.outer(t, omega))
    f = sine @ a + cosine @ b - b.sum(axis=0)
    df = (cosine * omega) @ a - (sine * omega) @ b
    ddf = -(sine * omega**2) @ a - (cosine * omega**2) @ b
    s = np.clip(t / 1.5, 0.0, 1.0)[:, None]
    w, dw = 10 * s**3 - 15 * s**4 + 6 * s**5, (30 * s**2 - 60 * s**3 + 30 * s**4) / 1.5
    ddw = (60 * s - 180 * s**2 + 120 * s**3) / 1.5**2
    q, v, acc = w * f, dw * f + w * df, ddw * f + 2 * dw * df + w * ddf
    share = rng.uniform(0.5, 1.0, n)  # of what the limits permit
    scale = share * np.minimum(0.6 * limit / np.abs(v).max(axis=0), (upper - lower) / np.ptp(q, axis=0))
    q, v, acc = q * scale, v * scale, acc * scale
    low, high = lower - q.min(axis=0), upper - q.max(axis=0)  # where the motion may be placed
    return Episode(q + low + (high - low) * rng.uniform(0.0, 1.0, n), v, acc)


def _pick_place(arm: Arm, seconds: float, speed: float, travel: float, rng: np.random.Generator) -> Episode:
    """Minimum-jerk moves from target to target with dwells of 0.2-1 s."""
    lower, upper, limit = ranges(arm)
    here = lower + (upper - lower) * rng.uniform(0.15, 0.85, len(lower))
    rows, elapsed = [], 0.0
    while elapsed < max(seconds - 0.5 * travel, 0.5):
        dwell = rng.uniform(0.2, 1.0)
        own_speed = speed * rng.uniform(0.5, 1.0) * limit
        target = lower + (upper - lower) * rng.uniform(0.05, 0.95, len(lower))
        # not farther than the time for one target permits
        reach = max(travel - dwell, 0.5) * own_speed / 1.875
        step = np.clip(target - here, -reach, reach)
        duration = max(0.4, (1.875 * np.abs(step) / own_speed).max()) * rng.uniform(1.0, 1.3)
        s = (np.arange(int(duration / TICK_SECS)) * TICK_SECS / duration)[:, None]
        q = here + step * (10 * s**3 - 15 * s**4 + 6 * s**5)
        v = step * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
        a = step * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
        here = here + step
        rest = np.zeros((int(dwell / TICK_SECS), len(here)))
        rows += [(q, v, a), (rest + here, rest, rest)]
        elapsed += (len(q) + len(rest)) * TICK_SECS
    q, v, a = (np.concatenate(part) for part in zip(*rows))
    return Episode(q, v, a)
