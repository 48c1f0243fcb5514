"""Publishes PointCloud2 messages over Zenoh as rmw_zenoh and the bridge from DDS do, until its input ends.

Usage: publish_points.py PORT. Needs what requirements.txt lists. None of the bytes are made by the code under test:
rosbags writes the messages, numpy the points.
"""

import sys
import threading
import time

import numpy as np
import zenoh
from rosbags.typesys import Stores, get_typestore

POINTS = 1000
STORE = get_typestore(Stores.ROS2_JAZZY)
CLOUD = "sensor_msgs/msg/PointCloud2"


def cloud(frame, little_endian):
    """Point i is at (1 + i / 2, -i, i % 7), and i + 0.25 bright, on ring i % 128."""
    order = "<" if little_endian else ">"
    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "u2")]
    offsets = [0, 4, 8, 16, 20]
    kind = np.dtype(
        {"names": [n for n, _ in kinds], "formats": [order + k for _, k in kinds], "offsets": offsets, "itemsize": 24}
    )
    i = np.arange(POINTS)
    points = np.zeros(POINTS, kind)
    points["x"], points["y"], points["z"] = 1 + i / 2, -i, i % 7
    points["intensity"], points["ring"] = i + 0.25, i % 128

    types = STORE.types
    field = types["sensor_msgs/msg/PointField"]
    number = {"f4": field.FLOAT32, "u2": field.UINT16}
    stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=123_456_789)
    message = types[CLOUD](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame),
        height=1,
        width=POINTS,
        fields=[field(name=n, offset=o, datatype=number[k], count=1) for (n, k), o in zip(kinds, offsets)],
        is_bigendian=not little_endian,
        point_step=kind.itemsize,
        row_step=points.nbytes,
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )
    return bytes(STORE.serialize_cdr(message, CLOUD, little_endian=little_endian))


def main():
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{int(sys.argv[1])}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    # The hash is the one that ROS 2 Jazzy has for this type.
    kind = "sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
    zid = session.info.zid()
    tokens = [
        session.liveliness().declare_token(f"@ros2_lv/0/{zid}/0/11/MP/%/%/lidar/%front%points/{kind}/::,:,:,:,,"),
        session.liveliness().declare_token(f"@/{zid}/@ros2_lv/MP/rear§points/sensor_msgs§msg§PointCloud2/:::"),
    ]
    publishers = [
        (session.declare_publisher(f"0/front/points/{kind}"), cloud("front_lidar", True)),
        (session.declare_publisher("rear/points"), cloud("rear_lidar", False)),
    ]
    end = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), end.set()), daemon=True).start()
    print("publishing", flush=True)
    while not end.wait(0.05):
        for publisher, message in publishers:
            # As rmw_zenoh: a number, a time and who sends it, which nobody has to read.
            publisher.put(message, attachment=time.time_ns().to_bytes(8, "little") * 4)
    for token in tokens:
        token.undeclare()
    session.close()


main()
