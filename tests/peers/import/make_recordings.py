"""Writes one simulated rig's log as recordings in the formats of others, by writers that know nothing of this project.

    python -m venv venv && venv/bin/pip install -r tests/peers/import/requirements.txt
    venv/bin/python tests/peers/import/make_recordings.py

It reads four episodes of `tests/data/mujoco-logs/logs/set-003` and writes `tests/data/import/`: the part of the log itself
(`original`), and the same measurements in other units, frames, orders and clocks. With `--whole DIR --source LOG` it writes all of another log
to DIR, with the same mappings: long enough to be diagnosed. Such a log has no added weights, which not every recording tells. Each recording has a mapping `NAME.toml`
beside it, written by hand; `crates/import-log/tests/peers.rs` imports each and compares with the original.

The tool of that log has no orientation. Here it gets one, a made-up function of time, so that wrenches in its axes can be
written; a sensor is mounted on it, turned and shifted. A tracker that sees the object is turned and shifted too.
"""

import argparse
import csv
import json
import pathlib
import shutil
import sqlite3

import numpy
import pyarrow
import pyarrow.parquet
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import CompressionType, Writer as McapWriter
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import StoragePlugin, Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

ROOT = pathlib.Path(__file__).resolve().parents[3]
SOURCE = ROOT / "tests/data/mujoco-logs/logs/set-003"
OUT = ROOT / "tests/data/import"
EPISODES, ROWS = 4, 32
START_NANOS = 1_767_225_600_123_456_789
PAUSE_NANOS = 5_000_000_000

# The frame of the tracker in the world, and of the sensor in the tool.
TRACKER_RPY_DEG, TRACKER_M = (10.0, -20.0, 130.0), (0.4, -0.3, 0.7)
SENSOR_RPY_DEG, SENSOR_M = (0.0, 180.0, 45.0), (0.01, -0.02, 0.09)


# Rotations as 3 x 3 matrices: another way than that of the importer.
def matrix_of_rpy(rpy):
    (sr, sp, sy), (cr, cp, cy) = numpy.sin(rpy), numpy.cos(rpy)
    about_x = numpy.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = numpy.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = numpy.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def matrix_of_quaternion(q):
    x, y, z, w = q / numpy.linalg.norm(q)
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def quaternion_of_matrix(m):
    values, vectors = numpy.linalg.eigh(numpy.array([
        [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
        [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
        [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
    ]))
    return vectors[:, numpy.argmax(values)]


def rpy_of_matrix(m):
    return numpy.array([numpy.arctan2(m[2, 1], m[2, 2]), -numpy.arcsin(m[2, 0]), numpy.arctan2(m[1, 0], m[0, 0])])


TRACKER = matrix_of_rpy(numpy.radians(TRACKER_RPY_DEG))
SENSOR = matrix_of_rpy(numpy.radians(SENSOR_RPY_DEG))


def tool_rpy(time):
    return numpy.array([0.3 * time, 0.2 * numpy.sin(time), 0.5 + time])


def joints(time):
    return [0.1 * joint + 0.5 * numpy.sin(time + joint) for joint in range(6)]


def vector(row, *names):
    cells = [row[name] for name in names]
    return None if "" in cells else numpy.array([float(cell) for cell in cells])


class Tick:
    """One row, in SI units and the world."""

    def __init__(self, row, nanos):
        self.episode, self.time, self.nanos = int(row["episode"]), float(row["time_secs"]), nanos
        self.command = vector(row, "command_x_m", "command_y_m", "command_z_m")
        self.tool = vector(row, "tool_x_m", "tool_y_m", "tool_z_m")
        self.force = vector(row, "wrist_fx_n", "wrist_fy_n", "wrist_fz_n")
        self.torque = vector(row, "wrist_tx_nm", "wrist_ty_nm", "wrist_tz_nm")
        self.object = vector(row, "object_x_m", "object_y_m", "object_z_m")
        self.quaternion = vector(row, "object_qx", "object_qy", "object_qz", "object_qw")
        self.added = float(row["added_mass_kg"])
        self.tool_matrix = matrix_of_rpy(tool_rpy(self.time))

    def in_tracker(self):
        """Position and quaternion of the object in the tracker's frame."""
        position = TRACKER.T @ (self.object - numpy.array(TRACKER_M))
        return position, quaternion_of_matrix(TRACKER.T @ matrix_of_quaternion(self.quaternion))

    def at_sensor(self):
        """What the sensor shows of the reaction: force and torque of the tool on the world, at the sensor, in its axes."""
        lever = self.tool_matrix @ numpy.array(SENSOR_M)
        torque = self.torque - numpy.cross(lever, self.force)
        axes = self.tool_matrix @ SENSOR
        return axes.T @ -self.force, axes.T @ -torque


def read_part():
    with open(SOURCE / "samples.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    part = []
    for episode in sorted({int(row["episode"]) for row in rows})[:EPISODES]:
        part += [row for row in rows if int(row["episode"]) == episode][:ROWS]
    return part


def write_original(part):
    folder = OUT / "original"
    folder.mkdir(parents=True)
    shutil.copy(SOURCE / "log.toml", folder / "log.toml")
    with open(folder / "samples.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, part[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(part)


def ticks(part):
    start = 0
    result = []
    for row in part:
        episode = int(row["episode"])
        start = START_NANOS + episode * PAUSE_NANOS
        result.append(Tick(row, start + round(float(row["time_secs"]) * 1e9)))
    return result


def ros_messages(store, tick):
    """Topic, type, message and whether it is there, for the MCAP bag."""
    types = store.types
    header = lambda frame: types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=tick.nanos // 10**9, nanosec=tick.nanos % 10**9), frame_id=frame)
    point = lambda v: types["geometry_msgs/msg/Point"](*map(float, v))
    vec = lambda v: types["geometry_msgs/msg/Vector3"](*map(float, v))
    quat = lambda q: types["geometry_msgs/msg/Quaternion"](*map(float, q))
    pose = lambda p, q: types["geometry_msgs/msg/Pose"](position=point(p), orientation=quat(q))
    yield "/tcp", "geometry_msgs/msg/PoseStamped", types["geometry_msgs/msg/PoseStamped"](
        header=header("world"), pose=pose(tick.tool, quaternion_of_matrix(tick.tool_matrix)))
    yield "/command", "geometry_msgs/msg/PointStamped", types["geometry_msgs/msg/PointStamped"](
        header=header("world"), point=point(tick.command))
    position, quaternion = tick.in_tracker()
    transform = lambda child, p, q: types["geometry_msgs/msg/TransformStamped"](
        header=header("tracker"), child_frame_id=child,
        transform=types["geometry_msgs/msg/Transform"](translation=vec(p), rotation=quat(q)))
    yield "/tf", "tf2_msgs/msg/TFMessage", types["tf2_msgs/msg/TFMessage"](
        transforms=[transform("lamp", (1, 2, 3), (0, 0, 0, 1)), transform("box", position, quaternion)])
    if tick.force is not None:
        force, torque = tick.at_sensor()
        yield "/ft_sensor", "geometry_msgs/msg/WrenchStamped", types["geometry_msgs/msg/WrenchStamped"](
            header=header("sensor"), wrench=types["geometry_msgs/msg/Wrench"](force=vec(force), torque=vec(torque)))
    yield "/trial", "std_msgs/msg/Int32", types["std_msgs/msg/Int32"](data=tick.episode)
    order = [3, 0, 5, 1, 4, 2]
    angles = joints(tick.time)
    yield "/joint_states", "sensor_msgs/msg/JointState", types["sensor_msgs/msg/JointState"](
        header=header(""), name=[f"j{joint}" for joint in order],
        position=numpy.array([angles[joint] for joint in order]), velocity=numpy.array([]), effort=numpy.array([]))


def write_bag(path, plugin, version, store, messages):
    connections = {}
    with BagWriter(path, version=version, storage_plugin=plugin) as writer:
        for nanos, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], nanos, store.serialize_cdr(message, kind))


def write_ros2_mcap(all_ticks):
    store = get_typestore(Stores.ROS2_JAZZY)
    # Recorded 7 ms after the stamp.
    messages = [(t.nanos + 7_000_000, *m) for t in all_ticks for m in ros_messages(store, t)]
    write_bag(OUT / "ros2_mcap", StoragePlugin.MCAP, 9, store, messages)


def write_ros2_sqlite(all_ticks):
    """A bag without definitions, in millimetres, without stamps: the times are those of the recorder."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    array = lambda values: store.types["std_msgs/msg/Float64MultiArray"](layout=layout, data=numpy.array(values))
    kind = "std_msgs/msg/Float64MultiArray"
    messages = []
    for tick in all_ticks:
        x, y, z, w = tick.quaternion
        messages.append((tick.nanos, "/mocap/box", kind, array([*(tick.object * 1e3), w, -x, -y, -z])))
        messages.append((tick.nanos, "/tool_mm", kind, array([*(tick.tool * 1e3), *(tick.command * 1e3)])))
        if tick.force is not None:
            messages.append((tick.nanos, "/wrench", kind, array([*-tick.force, *(-tick.torque * 1e3)])))
    path = OUT / "ros2_sqlite"
    write_bag(path, StoragePlugin.SQLITE3, 8, store, messages)
    # As before ROS 2 Iron, which added this table.
    for file in path.glob("*.db3"):
        base = sqlite3.connect(file)
        base.execute("DROP TABLE IF EXISTS message_definitions")
        base.commit()
        base.execute("VACUUM")
        base.close()


def write_ros2msg_mcap(all_ticks):
    """By the writer of the MCAP project: one message type of its own with all of it."""
    definition = "\n".join([
        "uint64 stamp_us", "float32[3] tool_cm", "my_rig/Box box", "int8 push", "float64[<=6] wrench",
        "================", "MSG: my_rig/Box", "bool seen", "float64[4] wxyz", "float64[3] at",
    ])
    with open(OUT / "own_message.mcap", "wb") as file:
        writer = Ros2Writer(file)
        schema = writer.register_msgdef("my_rig/msg/State", definition)
        for tick in all_ticks:
            x, y, z, w = map(float, tick.quaternion)
            wrench = [] if tick.force is None else [*map(float, tick.force), *map(float, tick.torque)]
            message = {
                "stamp_us": tick.nanos // 1000, "tool_cm": [float(v) for v in tick.tool * 100],
                "box": {"seen": True, "wxyz": [w, x, y, z], "at": [float(v) for v in tick.object]},
                "push": tick.episode, "wrench": wrench,
            }
            writer.write_message("/rig", schema, message, log_time=tick.nanos, publish_time=tick.nanos)
        writer.finish()


def write_json_mcap(all_ticks):
    with open(OUT / "json.mcap", "wb") as file:
        writer = McapWriter(file, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("Rig", "jsonschema", json.dumps({"type": "object"}).encode())
        channel = writer.register_channel("/rig", "json", schema)
        xyz = lambda v: dict(zip("xyz", map(float, v)))
        for tick in all_ticks:
            data = {
                "timestamp": {"sec": tick.nanos // 10**9, "nsec": tick.nanos % 10**9},
                "trial": f"push {tick.episode}",
                "tcp": {"position": xyz(tick.tool)},
                "goal": xyz(tick.command),
                "bodies": [{"name": "lamp", "pose": None}, {"name": "box", "pose": {
                    "position": xyz(tick.object),
                    "orientation": dict(zip("xyzw", map(float, -tick.quaternion)))}}],
                "ft": None if tick.force is None else {"force": xyz(tick.force), "torque": xyz(tick.torque)},
                "weight_g": tick.added * 1e3,
            }
            writer.add_message(channel, log_time=tick.nanos, publish_time=tick.nanos, data=json.dumps(data).encode())
        writer.finish()


def write_protobuf_mcap(all_ticks):
    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    field = descriptor_pb2.FieldDescriptorProto
    vec, state = file.message_type.add(name="Vec"), file.message_type.add(name="State")
    for number, name in enumerate("xyz", 1):
        vec.field.add(name=name, number=number, type=field.TYPE_DOUBLE, label=field.LABEL_OPTIONAL)
    state.field.add(name="stamp_ns", number=1, type=field.TYPE_INT64, label=field.LABEL_OPTIONAL)
    for number, name in enumerate(["tool", "object", "force", "torque"], 2):
        state.field.add(
            name=name, number=number, type=field.TYPE_MESSAGE, type_name=".rig.Vec", label=field.LABEL_OPTIONAL)
    state.field.add(name="xyzw", number=6, type=field.TYPE_DOUBLE, label=field.LABEL_REPEATED)
    state.field.add(name="trial", number=7, type=field.TYPE_UINT32, label=field.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("rig.State"))
    with open(OUT / "protobuf.mcap", "wb") as out, ProtobufWriter(out) as writer:
        for tick in all_ticks:
            parts = {"tool": tick.tool, "object": tick.object, "force": tick.force, "torque": tick.torque}
            vecs = {name: dict(zip("xyz", map(float, v))) for name, v in parts.items() if v is not None}
            message = kind(stamp_ns=tick.nanos, xyzw=map(float, tick.quaternion), trial=tick.episode, **vecs)
            writer.write_message("/rig", message, log_time=tick.nanos, publish_time=tick.nanos)


def write_lerobot(all_ticks):
    """Degrees and floats of 32 bits, as LeRobot keeps them."""
    folder = OUT / "lerobot"
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    state_names = [*(f"tool_{a}" for a in "xyz"), *(f"box_{a}" for a in ["x", "y", "z", "roll", "pitch", "yaw"])]
    state = [[*t.tool, *t.object, *numpy.degrees(rpy_of_matrix(matrix_of_quaternion(t.quaternion)))] for t in all_ticks]
    wrench = [[numpy.nan] * 6 if t.force is None else [*t.force, *t.torque] for t in all_ticks]
    floats = lambda rows: pyarrow.array(rows, pyarrow.list_(pyarrow.float32()))
    frames = [t.nanos for t in all_ticks]
    table = pyarrow.table({
        "observation.state": floats(state),
        "observation.wrench": floats(wrench),
        "action": floats([list(t.command) for t in all_ticks]),
        "timestamp": pyarrow.array([t.time for t in all_ticks], pyarrow.float32()),
        "frame_index": pyarrow.array([round(t.time / 0.02) for t in all_ticks], pyarrow.int64()),
        "episode_index": pyarrow.array([t.episode for t in all_ticks], pyarrow.int64()),
        "index": pyarrow.array(range(len(frames)), pyarrow.int64()),
        "task_index": pyarrow.array([0] * len(frames), pyarrow.int64()),
    })
    pyarrow.parquet.write_table(table, folder / "data/chunk-000/file-000.parquet", compression="snappy")
    feature = lambda names: {"dtype": "float32", "shape": [len(names)], "names": names}
    info = {
        "codebase_version": "v3.0", "robot_type": "rig", "total_episodes": 1 + all_ticks[-1].episode, "total_frames": len(frames), "fps": 50,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {
            "observation.state": feature(state_names),
            "observation.wrench": feature(["fx", "fy", "fz", "tx", "ty", "tz"]),
            "action": feature({"command": ["x", "y", "z"]}["command"]),
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            "episode_index": {"dtype": "int64", "shape": [1], "names": None},
        },
    }
    (folder / "meta/info.json").write_text(json.dumps(info, indent=1) + "\n")


def write_csv(all_ticks):
    """As a spreadsheet in German writes it: degrees, millimetres, milliseconds of a clock, quaternions w first."""
    comma = lambda value: f"{value:.9g}".replace(".", ",")
    with open(OUT / "rig.csv", "w", newline="", encoding="utf-8-sig") as file:
        writer = csv.writer(file, delimiter=";", lineterminator="\r\n")
        writer.writerow([
            "Versuch", "t_ms", *(f"tcp_{a}_mm" for a in "xyz"), *(f"tcp_{a}_deg" for a in ["roll", "pitch", "yaw"]),
            *(f"soll_{a}_mm" for a in "xyz"), *(f"kiste_{a}_mm" for a in "xyz"), *(f"kiste_q{a}" for a in "wxyz"),
            *(f"F{a}_N" for a in "xyz"), *(f"M{a}_mNm" for a in "xyz"), "Gewicht_g", "Notiz"])
        for tick in all_ticks:
            x, y, z, w = tick.quaternion
            wrench = ["", "", "", "nan", "nan", "nan"]
            if tick.force is not None:
                turned = tick.tool_matrix.T
                wrench = [comma(v) for v in [*(turned @ tick.force), *(turned @ tick.torque * 1e3)]]
            numbers = [*(tick.tool * 1e3), *numpy.degrees(tool_rpy(tick.time)), *(tick.command * 1e3), *(tick.object * 1e3)]
            writer.writerow([
                tick.episode, comma(tick.nanos // 10**6 - START_NANOS // 10**6), *map(comma, numbers),
                *map(comma, [w, x, y, z]), *wrench, comma(tick.added * 1e3), "ok"])


def main():
    global OUT, SOURCE, EPISODES, ROWS, PAUSE_NANOS
    parser = argparse.ArgumentParser(description="Writes recordings of one rig in the formats of others.")
    parser.add_argument("--whole", type=pathlib.Path, metavar="DIR", help="the whole log, to this new folder")
    parser.add_argument("--source", type=pathlib.Path, metavar="LOG", default=SOURCE, help="folder of that log")
    arguments = parser.parse_args()
    whole = arguments.whole
    if whole is not None:
        whole.mkdir(parents=True)
        for path in OUT.glob("*.toml"):
            shutil.copy(path, whole / path.name)
        OUT, SOURCE, EPISODES, ROWS = whole.resolve(), arguments.source, 10**6, 10**6
        # Longer than an episode.
        PAUSE_NANOS = 10**12
    for path in OUT.glob("*"):
        if path.suffix != ".toml" and path.name != "README.md":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    part = read_part()
    write_original(part)
    all_ticks = ticks(part)
    for write in [write_ros2_mcap, write_ros2_sqlite, write_ros2msg_mcap, write_json_mcap, write_protobuf_mcap,
                  write_lerobot, write_csv]:
        write(all_ticks)
    total = sum(path.stat().st_size for path in OUT.rglob("*") if path.is_file())
    print(f"{OUT}: {total} bytes")


if __name__ == "__main__":
    main()
