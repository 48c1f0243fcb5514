"""Writes recordings with other programs, and describes their points: recordings.py FOLDER [SEED].

Needs the packages of requirements.txt. Layouts are random; the same seed gives the same layouts. Each recording NAME has a
NAME.json with topic, stamp and columns of every frame in the common coordinate frame, with null for NaN. For recordings
with transforms the file also has the position of the sensor.
"""

import json
import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START = 1_700_000_000_000_000_000
CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
# Name and size of the types of PointField, in the order of their numbers.
TYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"]
NAMES = ["a_i", "b_u", "gap", "line", "tag", "time", "speed", "echo"]

ros1 = get_typestore(Stores.ROS1_NOETIC)
ros2 = get_typestore(Stores.ROS2_JAZZY)
for store in [ros1, ros2]:
    if TRANSFORMS not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))


def layout(rng, style):
    """A numpy type of a point, with fields in any order, at any offset, of any type."""
    if style == "packed":
        return np.dtype({"names": ["x", "y", "z"], "formats": ["<f4"] * 3, "offsets": [0, 4, 8], "itemsize": 12})
    order = ">" if style == "big" else "<"
    wanted = [(axis, rng.choice(["f4", "f8"]), 1) for axis in "xyz"]
    wanted.append(("intensity", rng.choice(["f4", "u2", "u1"]), 1))
    for name in rng.permutation(NAMES)[: rng.integers(1, 6)]:
        wanted.append((str(name), TYPES[rng.integers(8)], int(rng.integers(1, 4))))
    names, formats, offsets = [], [], []
    at = int(rng.integers(0, 6))
    for index in rng.permutation(len(wanted)):
        name, kind, count = wanted[index]
        names.append(name)
        formats.append(order + str(kind) if count == 1 else (order + str(kind), (count,)))
        offsets.append(at)
        at += np.dtype(str(kind)).itemsize * count + int(rng.integers(0, 5))
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at + int(rng.integers(0, 9))})


def points(rng, kind, count):
    """Points of such a type, some of them no returns or NaN."""
    cloud = np.zeros(count, kind)
    for name in kind.names:
        base = kind[name].base
        shape = cloud[name].shape
        if base.kind == "f":
            cloud[name] = rng.uniform(-50, 50, shape)
        else:
            limits = np.iinfo(base)
            cloud[name] = rng.integers(limits.min, limits.max, shape, dtype=np.int64)
    for index in range(count):
        lot = rng.integers(10)
        if lot == 0:
            for axis in "xyz":
                cloud[axis][index] = 0
        elif lot == 1:
            for axis in "xyz":
                cloud[axis][index] = np.nan
    return cloud


def message(store, rng, cloud, height, stamp, frame):
    """The cloud as a message, with padding between rows if it has several."""
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    field = store.types["sensor_msgs/msg/PointField"]
    kind, width = cloud.dtype, len(cloud) // height
    fields = []
    for name in kind.names:
        own, offset = kind.fields[name][:2]
        count = int(np.prod(own.shape)) if own.shape else 1
        fields.append(field(name=name, offset=offset, datatype=TYPES.index(own.base.str[1:]) + 1, count=count))
    rng.shuffle(fields)
    gap = int(rng.integers(0, 20)) if height > 1 else 0
    rows = [cloud[row * width : (row + 1) * width].tobytes() + b"\xee" * gap for row in range(height)]
    big = any(kind[name].base.str[0] == ">" for name in kind.names)
    extra = {"seq": 3} if store is ros1 else {}
    return store.types[CLOUD](
        header=header(stamp=time, frame_id=frame, **extra),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=big,
        point_step=kind.itemsize,
        row_step=kind.itemsize * width + gap,
        data=np.frombuffer(b"".join(rows), np.uint8),
        is_dense=True,
    )


def quaternion(axis, angle):
    axis = np.array(axis) / np.linalg.norm(axis)
    return np.array([*(axis * np.sin(angle / 2)), np.cos(angle / 2)])


def matrix(rotation, translation):
    x, y, z, w = rotation
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = translation
    return pose


def transforms(store, entries):
    """A message of transforms. Entries are stamp, parent, child, rotation, translation."""
    kind = store.types
    made = []
    for stamp, parent, child, rotation, translation in entries:
        time = kind["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {"seq": 0} if store is ros1 else {}
        x, y, z, w = map(float, rotation)
        turn = kind["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)
        place = kind["geometry_msgs/msg/Vector3"](*map(float, translation))
        made.append(
            kind["geometry_msgs/msg/TransformStamped"](
                header=kind["std_msgs/msg/Header"](stamp=time, frame_id=parent, **extra),
                child_frame_id=child,
                transform=kind["geometry_msgs/msg/Transform"](translation=place, rotation=turn),
            )
        )
    return kind[TRANSFORMS](transforms=made)


def expected(cloud, topic, stamp, pose):
    """Columns of the points in the common coordinate frame, without points at zero."""
    here = ~((cloud["x"] == 0) & (cloud["y"] == 0) & (cloud["z"] == 0))
    cloud = cloud[here]
    place = np.stack([cloud[axis].astype(float) for axis in "xyz"] + [np.ones(len(cloud))])
    place = pose @ place
    columns = dict(zip("xyz", place[:3]))
    for name in cloud.dtype.names:
        if name in "xyz":
            continue
        values = cloud[name].astype(float)
        if values.ndim == 1:
            columns["Intensity" if name == "intensity" else name] = values
        else:
            for index in range(values.shape[1]):
                columns[f"{name}_{index}"] = values[:, index]
    columns = {name: [None if np.isnan(v) else v for v in values.tolist()] for name, values in columns.items()}
    return {"topic": topic, "stamp": stamp, "columns": columns, "sensor": pose[:3, 3].tolist()}


def recording(store, rng, styles, with_transforms):
    """Messages of a recording (topic, type, time, message), and its expected frames."""
    messages, frames = [], []
    mounts = {}
    for index, _ in enumerate(styles):
        mounts[index] = (quaternion(rng.normal(size=3), 0.3 + index), rng.uniform(-2, 2, 3))
    if with_transforms:
        entries = [(START, "base", f"sensor{i}", *mount) for i, mount in mounts.items()]
        messages.append(("/tf_static", TRANSFORMS, START, transforms(store, entries)))
        for step in range(12):
            stamp = START + step * 10**8
            turn, place = quaternion([0, 0, 1], 0.2 * step), [step * 1.5, 0.25 * step, 0]
            messages.append(("/tf", TRANSFORMS, stamp, transforms(store, [(stamp, "map", "base", turn, place)])))
    for step in range(6):
        for index, style in enumerate(styles):
            stamp = START + step * 15 * 10**7 + index * 10**7
            height = int(rng.integers(2, 5)) if style == "image" else 1
            cloud = points(rng, layout(rng, style), height * int(rng.integers(1, 60)))
            pose = np.eye(4)
            if with_transforms:
                # Between two poses a rotation about one axis is uniform.
                share = (stamp - START) / 10**8
                robot = matrix(quaternion([0, 0, 1], 0.2 * share), [share * 1.5, 0.25 * share, 0])
                pose = robot @ matrix(*mounts[index])
            topic = f"/sensor{index}/points"
            made = message(store, rng, cloud, height, stamp, f"sensor{index}")
            messages.append((topic, CLOUD, stamp + 1000 + index, made))
            frames.append(expected(cloud, topic, stamp, pose))
    messages.sort(key=lambda message: message[2])
    return messages, frames


def write_mcap(path, store, messages, **options):
    """Writes with the mcap package; rosbags serializes the messages."""
    with open(path, "wb") as file:
        writer = McapWriter(file, chunk_size=8000, **options)
        writer.start()
        channels = {}
        for topic, kind, time, made in messages:
            if topic not in channels:
                name = kind.replace("/msg/", "/") if store is ros1 else kind
                schema = writer.register_schema(name, "ros1msg" if store is ros1 else "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "ros1" if store is ros1 else "cdr", schema)
            data = store.serialize_ros1(made, kind) if store is ros1 else store.serialize_cdr(made, kind)
            writer.add_message(channels[topic], time, bytes(data), time)
        writer.finish()


def plain(value):
    """A message of rosbags as dictionaries."""
    if hasattr(value, "__dataclass_fields__"):
        return {n: plain(getattr(value, n)) for n in value.__dataclass_fields__ if not n.startswith("__")}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


def write_mcap_ros2(path, messages):
    """Writes with mcap-ros2-support, which has its own CDR serializer."""
    with open(path, "wb") as file:
        writer = Ros2Writer(file, chunk_size=20_000, compression=CompressionType.LZ4)
        schemas = {}
        for topic, kind, time, made in messages:
            if kind not in schemas:
                text = ros2.generate_msgdef(kind, ros_version=2)[0]
                schemas[kind] = writer.register_msgdef(kind, text)
            writer.write_message(topic, schemas[kind], plain(made), time, time)
        writer.finish()


def write_bag1(path, messages, compression):
    writer = Bag1Writer(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for topic, kind, time, made in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ros1)
            writer.write(connections[topic], time, ros1.serialize_ros1(made, kind))


def write_bag2(path, messages, compressed):
    writer = Bag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, time, made in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ros2)
            writer.write(connections[topic], time, ros2.serialize_cdr(made, kind))


def main():
    folder, seed = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    styles = ["packed", "any", "big", "image"]

    def one(name, store, write, with_transforms):
        messages, frames = recording(store, rng, styles, with_transforms)
        write(folder / name, messages)
        (folder / f"{name}.json").write_text(json.dumps({"transforms": with_transforms, "frames": frames}))

    for store, kind in [(ros1, "ros1"), (ros2, "cdr")]:
        for compression in CompressionType:
            options = {"compression": compression}
            name = f"{kind}_{compression.name.lower()}"
            one(f"{name}.mcap", store, lambda p, m: write_mcap(p, store, m, **options), False)
            one(f"{name}_tf.mcap", store, lambda p, m: write_mcap(p, store, m, **options), True)
            bare = options | {"index_types": IndexType.NONE, "repeat_channels": False, "use_statistics": False}
            one(f"{name}_bare.mcap", store, lambda p, m: write_mcap(p, store, m, **bare), True)
        one(f"{kind}_loose.mcap", store, lambda p, m: write_mcap(p, store, m, use_chunking=False), True)
    one("own_cdr.mcap", ros2, write_mcap_ros2, True)
    for compression in [None, Bag1Writer.CompressionFormat.BZ2, Bag1Writer.CompressionFormat.LZ4]:
        name = compression.name.lower() if compression else "none"
        one(f"{name}.bag", ros1, lambda p, m: write_bag1(p, m, compression), True)
    one("folder", ros2, lambda p, m: write_bag2(p, m, False), True)
    one("folder_zstd", ros2, lambda p, m: write_bag2(p, m, True), True)


if __name__ == "__main__":
    main()
