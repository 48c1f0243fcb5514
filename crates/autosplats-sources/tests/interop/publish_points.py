"""Publishes PointCloud2 messages over Zenoh like rmw_zenoh and the bridge from DDS, until the input ends.

Usage: publish_points.py PORT [POINTS SECONDS]. Needs the packages of requirements.txt. The code under test makes none of
the bytes: rosbags writes the messages, numpy the points.

Two sensors send twenty times a second, and their robot sends transforms. Fixed transforms are sent once, before anybody
listens, to the cache of Zenoh's advanced publisher. With POINTS and SECONDS, only the first sensor sends, with that number
of points and the time of sending as stamp. At the end the number of messages is printed.
"""

import sys
import threading
import time

import numpy as np
import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
CLOUD = "sensor_msgs/msg/PointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
if TRANSFORMS not in STORE.types:
    STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
# Hashes of these types in ROS 2 Jazzy.
POINTS_KEY = (
    "sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
)
TRANSFORMS_KEY = (
    "tf2_msgs::msg::dds_::TFMessage_/RIHS01_e369d0f05a23ae52508854b66f6aa04437f3449d652e8cbf61d5abe85d020087"
)
# Seconds and nanoseconds of the first stamp.
STAMP = (1_700_000_000, 123_456_789)
PERIOD = 0.05


def header(sec, nanosec, frame):
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def transforms(entries):
    """A message of transforms. Entries are seconds, parent, child, x, y, z."""
    types = STORE.types
    made = [
        types["geometry_msgs/msg/TransformStamped"](
            header=header(sec, STAMP[1], parent),
            child_frame_id=child,
            transform=types["geometry_msgs/msg/Transform"](
                translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z),
                rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        for sec, parent, child, x, y, z in entries
    ]
    return bytes(STORE.serialize_cdr(types[TRANSFORMS](transforms=made), TRANSFORMS))


def cloud(frame, little_endian, count=1000, wave=False):
    """Point i is at (1 + i / 2, -i, i % 7) or on a wavy square, with intensity i + 0.25 and ring i % 128."""
    order = "<" if little_endian else ">"
    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "u2")]
    offsets = [0, 4, 8, 16, 20]
    kind = np.dtype(
        {"names": [n for n, _ in kinds], "formats": [order + k for _, k in kinds], "offsets": offsets, "itemsize": 24}
    )
    i = np.arange(count)
    points = np.zeros(count, kind)
    points["x"], points["y"], points["z"] = 1 + i / 2, -i, i % 7
    if wave:
        side = int(np.sqrt(count))
        points["x"], points["y"] = i % side / side * 20, i // side / side * 20
        # Away from the origin, which would mean no return.
        points["z"] = np.sin(points["x"]) * np.cos(points["y"]) - 3
    points["intensity"], points["ring"] = i + 0.25, i % 128

    types = STORE.types
    field = types["sensor_msgs/msg/PointField"]
    number = {"f4": field.FLOAT32, "u2": field.UINT16}
    message = types[CLOUD](
        header=header(*STAMP, frame),
        height=1,
        width=count,
        fields=[field(name=n, offset=o, datatype=number[k], count=1) for (n, k), o in zip(kinds, offsets)],
        is_bigendian=not little_endian,
        point_step=kind.itemsize,
        row_step=points.nbytes,
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )
    return bytes(STORE.serialize_cdr(message, CLOUD, little_endian=little_endian))


def router(port):
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    # Messages in the cache need a time stamp.
    config.insert_json5("timestamping/enabled", "true")
    return zenoh.open(config)


def robot(session):
    """Two sensors on a moving robot, one with rmw_zenoh and one behind the bridge, each with its own transforms."""
    zid = session.info.zid()
    publishers, kept = [], []
    for place, (side, x, little_endian) in enumerate([("front", 1.0, True), ("rear", -1.0, False)]):
        bridged = side == "rear"
        names = {name: (kind if bridged else key) for name, kind, key in [
            (f"{side}/points", "sensor_msgs§msg§PointCloud2", POINTS_KEY),
            ("tf", "tf2_msgs§msg§TFMessage", TRANSFORMS_KEY),
            ("tf_static", "tf2_msgs§msg§TFMessage", TRANSFORMS_KEY),
        ]}
        keys = {}
        for number, (name, kind) in enumerate(names.items()):
            if bridged:
                keys[name] = name
                token = f"@/{zid}/@ros2_lv/MP/{name.replace('/', '§')}/{kind}/:::"
            else:
                keys[name] = f"0/{name}/{kind}"
                topic = "%" + name.replace("/", "%")
                token = f"@ros2_lv/0/{zid}/0/{place * 10 + number}/MP/%/%/lidar/{topic}/{kind}/::,:,:,:,,"
            kept.append(session.liveliness().declare_token(token))
        # The points are measured at a time between two poses of the robot.
        moving = transforms([(STAMP[0] - 1, "odom", "base", 5.0, 20.0, 0.0), (STAMP[0] + 1, "odom", "base", 15.0, 20.0, 0.0)])
        publishers.append((session.declare_publisher(keys["tf"]), moving))
        points = cloud(f"{side}_lidar", little_endian)
        publishers.append((session.declare_publisher(keys[f"{side}/points"]), points))
        fixed = zenoh.ext.declare_advanced_publisher(
            session, keys["tf_static"], cache=zenoh.ext.CacheConfig(max_samples=1), publisher_detection=True
        )
        fixed.put(transforms([(0, "base", f"{side}_lidar", x, 0.0, 0.5)]))
        kept.append(fixed)
    end = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), end.set()), daemon=True).start()
    print("publishing", flush=True)
    while not end.wait(PERIOD):
        for publisher, message in publishers:
            # The attachment of rmw_zenoh: number, time and sender, which receivers may ignore.
            publisher.put(message, attachment=time.time_ns().to_bytes(8, "little") * 4)
    for thing in kept:
        thing.undeclare()


def sensor(session, count, seconds):
    """One sensor that sends at a constant rate once somebody listens."""
    message = bytearray(cloud("lidar", True, count, wave=True))
    # Without this, the sender itself drops messages on a busy machine.
    publisher = session.declare_publisher(f"0/points/{POINTS_KEY}", congestion_control=zenoh.CongestionControl.BLOCK)
    print("publishing", flush=True)
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    begun, sent = time.monotonic(), 0
    while time.monotonic() - begun < seconds:
        # The stamp follows the four header bytes.
        sec, nanosec = divmod(time.time_ns(), 1_000_000_000)
        message[4:12] = sec.to_bytes(4, "little") + nanosec.to_bytes(4, "little")
        publisher.put(bytes(message))
        sent += 1
        time.sleep(max(0.0, begun + sent * PERIOD - time.monotonic()))
    # Messages on their way may still arrive.
    time.sleep(1)
    print(sent, flush=True)


def main():
    session = router(sys.argv[1])
    if len(sys.argv) > 2:
        sensor(session, int(sys.argv[2]), float(sys.argv[3]))
    else:
        robot(session)
    session.close()


main()
