"""Draws a scene and a rig as most laboratories have them: an object for one hand, a camera and a force sensor at 50 to 125 Hz, all sensors there,
clocks nearly together, forces as means over a tick, mass and friction known to 10 %. `scene.py` draws from everything that could be.
"""

from scene import Bodies, Rig, Scene, draw_body, draw_kind, log_uniform, stated

SHAPES = {"box": 0.55, "upright": 0.25, "lying": 0.1, "sphere": 0.1}
# As heavy as wood, plastic or a filled can.
BODIES = Bodies(length_m=(0.04, 0.2), friction=(0.2, 0.55), width=0.5, height=0.4, density_kgm3=(200.0, 1500.0), mass_kg=(0.05, 3.0), digits=3)


def draw_scene(rng, unsuitable=()):
    kind = draw_kind(rng, SHAPES, unsuitable)
    size, mass, friction = draw_body(rng, kind, BODIES)
    tool_friction = float(round(rng.uniform(0.1, 0.4), 3))
    scene = Scene(kind, size, mass, friction, tool_friction, 0.0, [0.5, 0.0], {})
    scene.tool_radius_m = round(float(min(rng.uniform(0.008, 0.025), 0.9 * scene.half_height_m)), 4)
    scene.stated = {"mass_kg": stated(rng, mass, False), "friction": stated(rng, friction, False),
                    "tool_friction": stated(rng, tool_friction, False)}
    return scene


def draw_rig(rng, scene):
    sensors = {"command", "tool", "force", "orientation"} | ({"torque"} if rng.random() < 0.5 else set())
    rig = Rig(designed=bool(rng.random() < 0.5), tosses=False, sensors=sensors)
    rig.period_s = round(1.0 / float(rng.choice([50, 60, 100, 125])), 4)
    rig.straight = True
    if rng.random() < 0.5:
        rig.jitter = float(rng.uniform(0.01, 0.05))
    if rng.random() < 0.3:
        rig.dropped = float(rng.uniform(0.005, 0.03))
    if rng.random() < 0.2:
        rig.lost_poses = float(rng.uniform(0.01, 0.1))
    rig.object_period_s = rig.force_period_s = rig.period_s
    rig.force_mean = True
    if rng.random() < 0.4:
        rig.skew_s = round(float(rng.uniform(-0.02, 0.02)), 4)
    force = float(rng.uniform(0.02, 0.15))
    noise = {
        "object_position_m": log_uniform(rng, 0.0002, 0.0015),
        "object_orientation_rad": log_uniform(rng, 0.002, 0.012),
        "object_velocity_mps": 0.01,
        "object_spin_rps": 0.1,
        "tool_position_m": log_uniform(rng, 0.00005, 0.0003),
        "wrist_force_n": force,
        "wrist_torque_nm": force * float(rng.uniform(0.01, 0.03)),
    }
    rig.noise = {key: float(f"{value:.3g}") for key, value in noise.items()}
    rig.noise_stated = set(rig.noise) if rng.random() < 0.6 else set()
    rig.episodes = int(rng.integers(24, 41))
    rig.long_rests = bool(rng.random() < 0.2)
    return rig
