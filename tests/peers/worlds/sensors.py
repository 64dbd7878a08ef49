"""What the rig reads of an episode: the catalogue's wrong sensors, rates, gaps, clocks and noise. Rows are those of samples.csv."""

import math

import numpy as np

GROUPS = {
    "command": [f"command_{a}_m" for a in "xyz"],
    "tool": [f"tool_{a}_m" for a in "xyz"],
    "force": [f"wrist_f{a}_n" for a in "xyz"],
    "torque": [f"wrist_t{a}_nm" for a in "xyz"],
    "position": [f"object_{a}_m" for a in "xyz"],
    "orientation": [f"object_q{a}" for a in "xyzw"],
    "linear": [f"object_v{a}_mps" for a in "xyz"],
    "spin": [f"object_w{a}_rps" for a in "xyz"],
}
NOISE_OF = {"tool": "tool_position_m", "force": "wrist_force_n", "torque": "wrist_torque_nm", "position": "object_position_m",
            "orientation": "object_orientation_rad", "linear": "object_velocity_mps", "spin": "object_spin_rps"}
OBJECT = ("position", "orientation", "linear", "spin")


def product(a, b):
    """Quaternions x, y, z, w, row by row."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a.T, b.T
    return np.stack([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                     aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz], axis=1)


def lerp(times, values, at):
    """Rows between rows, the first and last held outside."""
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = np.clip((at - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)[:, None]
    return values[k] * (1 - share) + values[k + 1] * share


def slerp(times, q, at):
    """Quaternions between neighbours that are close: linear, then normalised."""
    flips = np.cumprod(np.concatenate([[1.0], np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)]))
    out = lerp(times, q * flips[:, None], at)
    return out / np.linalg.norm(out, axis=1)[:, None]


def stamps(rng, rig, period_s, end_s):
    """Times of readings from 0 on; a reading is taken when its stamp says, or the skew beside it."""
    times = np.arange(int(end_s / period_s) + 1) * period_s
    if rig.jitter:
        times[1:] += np.clip(rng.normal(0.0, rig.jitter, len(times) - 1), -0.4, 0.4) * period_s
    kept = rng.random(len(times)) >= rig.dropped
    kept[0] = True
    return np.round(times[kept & (times <= end_s)], 5)


def draw_stamps(rng, rig, end_s):
    """Times of tool and command, of the force and of the object."""
    ticks = stamps(rng, rig, rig.period_s, end_s)
    if not rig.own_rows:
        seen = ticks[np.concatenate([[True], rng.random(len(ticks) - 1) >= rig.lost_poses])]
        return {"tool": ticks, "force": ticks, "object": seen}
    seen = stamps(rng, rig, rig.object_period_s, end_s)
    seen = seen[np.concatenate([[True], rng.random(len(seen) - 1) >= rig.lost_poses])]
    return {"tool": ticks, "force": stamps(rng, rig, rig.force_period_s, end_s), "object": seen}


def read_object(trace, at, effects, rate):
    """Readings of the object at true times."""
    if "frozen_camera" in effects:
        p = effects["frozen_camera"]
        at = np.where((at >= p["begin_secs"]) & (at < p["begin_secs"] + p["length_secs"]), p["begin_secs"], at)
    if "pose_delay" in effects:
        at = at - effects["pose_delay"]["delay_secs"]
    position, q = lerp(trace.time_s, trace.pose[:, :3], at), slerp(trace.time_s, trace.pose[:, 3:], at)
    linear, spin = lerp(trace.time_s, trace.velocity[:, :3], at) / rate, lerp(trace.time_s, trace.velocity[:, 3:], at) / rate
    if "pose_offset" in effects:
        position = position + [effects["pose_offset"][f"offset_{a}_m"] for a in "xyz"]
    if "pose_scale" in effects:
        position, linear = position * effects["pose_scale"]["scale"], linear * effects["pose_scale"]["scale"]
    if "pose_rotation" in effects:
        yaw = effects["pose_rotation"]["yaw_rad"]
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        position, linear, spin = position @ turn, linear @ turn, spin @ turn
        q = product(np.repeat([[0, 0, math.sin(yaw / 2), math.cos(yaw / 2)]], len(q), axis=0), q)
    return {"position": position, "orientation": q, "linear": linear, "spin": spin}


def read_force(trace, at, effects, rig):
    """Wrenches at true times: means since the reading before, or of the physics step."""
    wrench = trace.wrench
    if "wrist_payload" in effects:
        p, h = effects["wrist_payload"], trace.time_s[1] - trace.time_s[0]
        pull = np.gradient(np.gradient(trace.tool, h, axis=0), h, axis=0)
        force = (np.array([0.0, 0.0, -9.81]) - pull) * p["mass_kg"]
        wrench = wrench + np.hstack([force, np.cross([p[f"com_{a}_m"] for a in "xyz"], force)])
    if rig.force_mean:
        h = trace.time_s[1] - trace.time_s[0]
        total = np.cumsum(wrench, axis=0) * h
        ends = lerp(trace.time_s, total, at)
        before = np.concatenate([[max(at[0] - rig.force_period_s, -h)], at[:-1]])
        begins = lerp(trace.time_s, total, before)
        out = (ends - begins) / np.maximum(at - before, 1e-9)[:, None]
        out[0] = wrench[0]
    else:
        out = wrench[np.clip(np.searchsorted(trace.time_s, at - 1e-9), 0, len(wrench) - 1)]
    out = out.copy()
    if "force_gain" in effects:
        out *= effects["force_gain"]["gain"]
    if "force_bias" in effects:
        out[:, :3] += [effects["force_bias"][f"bias_{a}_n"] for a in "xyz"]
    if "force_drift" in effects:
        out[:, :3] += np.outer(at, [effects["force_drift"][f"drift_{a}_nps"] for a in "xyz"])
    if "force_low_pass" in effects:
        constant = effects["force_low_pass"]["time_constant_secs"]
        for k in range(1, len(out)):
            kept = math.exp(-(at[k] - at[k - 1]) / constant)
            out[k] = kept * out[k - 1] + (1 - kept) * out[k]
    if "force_saturation" in effects:
        limit = effects["force_saturation"]["limit_n"]
        out[:, :3] = np.clip(out[:, :3], -limit, limit)
    return {"force": out[:, :3], "torque": out[:, 3:]}


def groups(rig):
    """Columns that the rig has."""
    out = [g for g in ("command", "tool", "force", "torque") if g in rig.sensors and not rig.tosses] + ["position", "orientation"]
    return out + (["linear", "spin"] if "velocity" in rig.sensors or rig.tosses else [])


def read(trace, times, effects, rig):
    """Readings without noise, {group: (times, values)}."""
    rate = effects["time_base"]["rate"] if "time_base" in effects else 1.0
    last = trace.time_s[-1] * rate
    times = {key: t[t <= last] for key, t in times.items()}
    out = {}
    if not rig.tosses:
        out["command"] = (times["tool"], lerp(trace.time_s, trace.command, times["tool"] / rate))
        out["tool"] = (times["tool"], lerp(trace.time_s, trace.tool, times["tool"] / rate))
        for key, values in read_force(trace, times["force"] / rate, effects, rig).items():
            out[key] = (times["force"], values)
    # The first reading is that of the state in which the episode begins.
    for key, values in read_object(trace, times["object"] / rate - rig.skew_s, effects, rate).items():
        out[key] = (times["object"], values)
    for key in ("linear", "spin"):
        if rig.tosses and "velocity" not in rig.sensors:
            out[key] = (out[key][0][:1], out[key][1][:1])
    if "orientation" not in rig.sensors:
        out["orientation"] = (out["orientation"][0][:1], out["orientation"][1][:1])
    return {key: out[key] for key in groups(rig)}


def noisy(rng, readings, rig):
    out = {}
    for key, (times, values) in readings.items():
        if key == "command":
            out[key] = (times, values)
            continue
        sigma = rig.noise[NOISE_OF[key]]
        if key == "orientation":
            turn = rng.normal(0.0, sigma, (len(values), 3)) / 2
            values = product(np.hstack([turn, np.ones((len(values), 1))]), values)
            values = values / np.linalg.norm(values, axis=1)[:, None]
        else:
            values = values + rng.normal(0.0, sigma, values.shape)
        out[key] = (times, values)
    return out


def difference(one, two, rig):
    """Mean square, in standard deviations of the noise, of how two sets of readings at the same times differ; and how many numbers that are."""
    total, count = 0.0, 0
    for key, (_, a) in one.items():
        b = two[key][1]
        n = min(len(a), len(b))
        if key == "command" or n == 0:
            continue
        sigma = rig.noise[NOISE_OF[key]]
        off = a[:n] - b[:n]
        if key == "orientation":
            # Twice the vector part of the turn between the two.
            off = 2.0 * product(a[:n], b[:n] * [-1, -1, -1, 1])[:, :3]
        total += float((np.clip(off / sigma, -1e3, 1e3) ** 2).sum())
        count += off.size
    return total, count


def lines(number, readings, rig, added_kg, designed):
    """Rows of samples.csv, readings of the same time in one row."""
    columns = [c for g in groups(rig) for c in GROUPS[g]]
    at = {c: i for i, c in enumerate(columns)}
    rows = {}
    for key, (times, values) in readings.items():
        small = min(rig.noise[NOISE_OF[key]] if key in NOISE_OF else 1e-5, 1e-3)
        digits = 6 if key == "orientation" else min(9, max(4, 2 - math.floor(math.log10(small))))
        for t, row in zip(times, values):
            cells = rows.setdefault(round(float(t), 5), [""] * len(columns))
            for column, value in zip(GROUPS[key], row):
                cells[at[column]] = text(value, digits)
    for t in sorted(rows):
        yield ",".join([str(number), text(t, 5), *rows[t]] + ([text(added_kg, 5)] if designed else []))


def text(value, digits):
    out = f"{value:.{digits}f}"
    out = out.rstrip("0").rstrip(".") if "." in out else out
    return "0" if out == "-0" else out
