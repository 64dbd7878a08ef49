"""Closed loop of a controller and an engine, at 1 kHz, and what sensors without noise would report."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine_mujoco import RigidModel
from motions import TICK_SECS, Episode
from scene import Bristles, Scene

LOST_RAD = 0.35  # a motion farther from its reference than this counts as diverged
SETTLE_TICKS = 1000  # the arm is held at the start of each episode for 1 s before the log begins


@dataclass
class Sensing:
    """Systematic errors of encoders, torque columns and servo.  Arrays have one entry per joint."""

    n: int
    encoder_offset: dict[int, float] = field(default_factory=dict)  # rad, measured minus true
    eccentricity: dict[int, tuple[float, float]] = field(default_factory=dict)  # amplitude rad, phase rad
    torque_gain: dict[int, float] = field(default_factory=dict)
    torque_offset: dict[int, float] = field(default_factory=dict)  # N m
    torque_drift: dict[int, float] = field(default_factory=dict)  # N m over the whole log
    torque_delay_secs: float = 0.0
    gravity_share: float = 0.0  # share of the gravity torque that the torque columns lack
    command_delay_secs: float = 0.0

    def position(self, q: np.ndarray) -> np.ndarray:
        """Measured motor position(s) for true ones; last axis: joints."""
        if not (self.encoder_offset or self.eccentricity):
            return q
        out = q.copy()
        for i, offset in self.encoder_offset.items():
            out[..., i] += offset
        for i, (amplitude, phase) in self.eccentricity.items():
            out[..., i] += amplitude * np.sin(q[..., i] + phase)
        return out

    def velocity(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Measured motor velocity(ies)."""
        if not self.eccentricity:
            return v
        out = v.copy()
        for i, (amplitude, phase) in self.eccentricity.items():
            out[..., i] *= 1.0 + amplitude * np.cos(q[..., i] + phase)
        return out


@dataclass
class Control:
    """PD gains (N m/rad, N m s/rad) and feed-forward: "computed_torque", "gravity" or "servo" (bare PD)."""

    kind: str
    stiffness: np.ndarray
    damping: np.ndarray
    nominal: RigidModel | None


@dataclass
class Track:
    """What happened in one episode at 1 kHz; row 0 is the start of the log."""

    command: np.ndarray  # reference position
    q: np.ndarray  # motor position
    v: np.ndarray
    deflection: np.ndarray  # link minus motor
    torque: np.ndarray  # reported by the drives, mean over the hold before and after the instant
    measured_q: np.ndarray  # without noise
    measured_v: np.ndarray
    measured_torque: np.ndarray
    exact_a: np.ndarray | None = None  # acceleration at the start of the step
    exact_friction: np.ndarray | None = None
    exact_torque: np.ndarray | None = None  # torque of that step
    secs: np.ndarray | None = None  # time since the start of the log, without the settling


def gravity_rows(model: RigidModel, q: np.ndarray) -> np.ndarray:
    zero = np.zeros(q.shape[-1])
    return np.array([model.inverse(row, zero, zero) for row in q])


def run_episode(engine, scene: Scene, control: Control, sensing: Sensing, reference: Episode, start_secs: float,
                log_secs: float, truth: RigidModel) -> Track:
    """Simulate one episode.  `start_secs`: log time at its start; `log_secs`: length of the whole log."""
    n = reference.q.shape[1]
    hold = np.zeros((SETTLE_TICKS, n))
    ref_q = np.concatenate([hold + reference.q[0], reference.q])
    ref_v, ref_a = np.concatenate([hold, reference.v]), np.concatenate([hold, reference.a])
    late = int(round(sensing.command_delay_secs / TICK_SECS))
    acting = np.concatenate([np.repeat(ref_q[:1], late, axis=0), ref_q])[: len(ref_q)]
    substeps = int(round(TICK_SECS / engine.step_secs))
    # start where the measured position is the reference, or, without gravity compensation, where the servo rests
    q = ref_q[0] - (sensing.position(ref_q[0]) - ref_q[0])
    if control.kind == "servo":
        q = q - truth.inverse(q, np.zeros(n), np.zeros(n)) / control.stiffness
    engine.reset(q)
    bristles = Bristles(scene)
    rows = len(ref_q)
    out_q, out_v, out_d, out_u = (np.zeros((rows, n)) for _ in range(4))
    exact_a, exact_f, exact_u = (np.zeros((rows, n)) for _ in range(3))
    zero = np.zeros(n)
    for k in range(rows):
        now = start_secs + max(k - SETTLE_TICKS, 0) * TICK_SECS
        for sub in range(substeps):
            q, v = engine.state()
            if sub == 0 or control.kind == "servo":
                seen_q, seen_v = sensing.position(q), sensing.velocity(q, v)
                if control.kind == "servo":  # the drive interpolates the commands of 1 kHz
                    target = acting[k] + sub / substeps * (acting[min(k + 1, rows - 1)] - acting[k])
                    u = control.stiffness * (target - seen_q) - control.damping * seen_v
                else:
                    error, rate = ref_q[k] - seen_q, ref_v[k] - seen_v
                    if control.kind == "computed_torque":
                        u = control.nominal.inverse(ref_q[k], ref_v[k], ref_a[k])
                    else:
                        u = control.nominal.inverse(seen_q, zero, zero)
                    u = u + control.stiffness * error + control.damping * rate
            if sub == 0:
                out_q[k], out_v[k], out_d[k], out_u[k] = q, v, engine.deflection(), u
            torque = scene.motor_torque(u, q, now)
            if bristles.laws:
                torque = bristles.add_torque(torque, v, engine.step_secs)
            engine.step(torque, now)
            if sub == 0:
                exact_u[k] = torque
                exact_a[k], exact_f[k] = engine.exact()
        if not np.isfinite(out_q[k]).all() or np.abs(ref_q[k] - out_q[k]).max() > LOST_RAD:
            raise FloatingPointError("the simulation diverged")
    # the drives hold a torque for a tick: at the instant between two holds they report the mean
    centred = out_u.copy()
    if control.kind != "servo":
        centred[1:] = 0.5 * (out_u[1:] + out_u[:-1])
    keep = slice(SETTLE_TICKS, None)
    secs = start_secs + np.arange(rows - SETTLE_TICKS) * TICK_SECS
    shift = sensing.torque_delay_secs / TICK_SECS
    index = np.arange(rows, dtype=float) - shift
    late_torque = np.stack([np.interp(index, np.arange(rows), column) for column in centred.T], axis=1)
    measured = late_torque[keep].copy()
    if sensing.gravity_share:
        measured -= sensing.gravity_share * gravity_rows(truth, (out_q + out_d)[keep])
    for i, gain in sensing.torque_gain.items():
        measured[:, i] *= gain
    for i, offset in sensing.torque_offset.items():
        measured[:, i] += offset
    for i, drift in sensing.torque_drift.items():
        measured[:, i] += drift * secs / log_secs
    q, v = out_q[keep], out_v[keep]
    return Track(ref_q[keep], q, v, out_d[keep], centred[keep], sensing.position(q), sensing.velocity(q, v), measured,
                 exact_a[keep], exact_f[keep], exact_u[keep], secs)


def run_log(engine_class, scene: Scene, control: Control, sensing: Sensing, motion: list[Episode]) -> list[Track]:
    """Simulate all episodes of a log."""
    stiff = bool(scene.elastic) or any(f.bristle_rad for f in scene.friction)
    engine = engine_class(scene, stiff)
    truth = RigidModel(scene)
    log_secs = sum(len(e.q) - 1 for e in motion) * TICK_SECS
    tracks, start = [], 0.0
    for episode in motion:
        tracks.append(run_episode(engine, scene, control, sensing, episode, start, log_secs, truth))
        start += (len(episode.q) - 1) * TICK_SECS
    return tracks


def misfit(tracks: list[Track], base: Scene, stiffness: np.ndarray | None, damping: np.ndarray | None) -> np.ndarray:
    """Mean square per joint of (clean measured torque - inverse dynamics of the arm without the effect).

    With `stiffness` the torque is that of the bare PD law on clean positions.  Known friction of `base` is
    subtracted; where a joint with known Coulomb friction (nearly) rests, its samples are left out.
    """
    model = RigidModel(base)
    coulomb = np.array([f.coulomb for f in base.friction])
    viscous = np.array([f.viscous for f in base.friction])
    total, count = np.zeros(len(coulomb)), np.zeros(len(coulomb))
    for track in tracks:
        rows = slice(2, -2, 4)
        q, v = track.measured_q[rows], track.measured_v[rows]
        a = np.gradient(track.measured_v, TICK_SECS, axis=0)[rows]
        if stiffness is None:
            torque = track.measured_torque[rows]
        else:
            torque = stiffness * (track.command[rows] - q) - damping * v
        difference = torque - model.inverse_rows(q, v, a) - viscous * v - coulomb * np.sign(v)
        used = (coulomb == 0.0) | (np.abs(v) > 0.01)
        total += np.where(used, difference**2, 0.0).sum(axis=0)
        count += used.sum(axis=0)
    return total / np.maximum(count, 1.0)
