# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 1 bags written byte by byte, as wiki.ros.org/Bags/Format/2.0 says."""
import bz2
import struct


def text(value):
    value = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(value)) + value


def fields(**values):
    packed = b""
    for name, value in values.items():
        packed += text(name.encode() + b"=" + (value if isinstance(value, bytes) else value.encode()))
    return packed


def record(header, data):
    return text(header) + text(data)


def stamp(seconds):
    return struct.pack("<II", int(seconds), round((seconds % 1) * 1e9))


def header(seconds, frame):
    return struct.pack("<I", 1) + stamp(seconds) + text(frame)


def transform(seconds, parent, child, xyz, quaternion=(0, 0, 0, 1)):
    """tf2_msgs/TFMessage of one."""
    return struct.pack("<I", 1) + header(seconds, parent) + text(child) + struct.pack("<7d", *xyz, *quaternion)


def cloud(seconds, frame, points):
    """sensor_msgs/PointCloud2 of x, y, z, intensity."""
    names = ("x", "y", "z", "intensity")
    body = b"".join(struct.pack("<4f", *p) for p in points)
    return (header(seconds, frame) + struct.pack("<III", 1, len(points), len(names)) +
            b"".join(text(n) + struct.pack("<IBI", 4 * i, 7, 1) for i, n in enumerate(names)) +
            struct.pack("<BII", 0, 16, 16 * len(points)) + text(body) + b"\1")


TYPES = {"/tf": "tf2_msgs/TFMessage", "/tf_static": "tf2_msgs/TFMessage", "/points": "sensor_msgs/PointCloud2"}


def bag_bytes(messages, compression="none"):
    """messages: (topic, seconds, bytes)."""
    numbers, inner, records = {}, b"", b""
    for topic, seconds, body in messages:
        if topic not in numbers:
            numbers[topic] = len(numbers)
            connection = record(fields(op=b"\7", conn=struct.pack("<I", numbers[topic]), topic=topic),
                                fields(topic=topic, type=TYPES[topic], md5sum="*", message_definition=""))
            inner, records = inner + connection, records + connection
        inner += record(fields(op=b"\2", conn=struct.pack("<I", numbers[topic]), time=stamp(seconds)), body)
    packed = bz2.compress(inner) if compression == "bz2" else inner
    chunk = record(fields(op=b"\5", compression=compression, size=struct.pack("<I", len(inner))), packed)
    head = fields(op=b"\3", index_pos=bytes(8), conn_count=struct.pack("<I", len(numbers)), chunk_count=struct.pack("<I", 1))
    return b"#ROSBAG V2.0\n" + record(head, b" " * (4096 - 8 - len(head))) + chunk + records
