"""Writes the recordings of other programs that tests and examples read.

Run in this folder with numpy 2.4, scipy 1.17, mcap-ros2-support 0.6 and rosbags 0.11:
python3 make.py
"""

import math
import shutil
from pathlib import Path

import numpy as np
import scipy.io
from mcap_ros2.writer import Writer as McapWriter

HERE = Path(__file__).parent
EXAMPLES = HERE / "../../../examples"
START_NS = 1_700_000_000_000_000_000

HEADER = """std_msgs/Header header
"""
STD = """================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
POINT = """================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
"""
VECTOR = POINT.replace("Point", "Vector3")
QUATERNION = """================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
JOINT_STATE = HEADER + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + STD
POSE = (HEADER + "geometry_msgs/Pose pose\n" + STD
        + "=" * 80 + "\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
        + POINT + QUATERNION)
WRENCH = (HEADER + "geometry_msgs/Wrench wrench\n" + STD
          + "=" * 80 + "\nMSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n" + VECTOR)


def header(ns, frame="base"):
    return {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": frame}


def xyz(x, y, z):
    return {"x": x, "y": y, "z": z}


def joints(ns, t, turned):
    names, position, effort = ["elbow", "base"], [0.5 - t, t], [2.0, 1.0 + t]
    if turned:
        names, position, effort = names[::-1], position[::-1], effort[::-1]
    return {"header": header(ns), "name": names, "position": position, "velocity": [], "effort": effort}


def ros_log(path):
    with open(path, "wb") as stream:
        writer = McapWriter(stream)
        schemas = {
            name: writer.register_msgdef(datatype="/".join(kind), msgdef_text=text)
            for name, kind, text in [
                ("joints", ("sensor_msgs/msg", "JointState"), JOINT_STATE),
                ("pose", ("geometry_msgs/msg", "PoseStamped"), POSE),
                ("wrench", ("geometry_msgs/msg", "WrenchStamped"), WRENCH),
                ("text", ("std_msgs/msg", "String"), "string data\n"),
            ]
        }
        write = lambda topic, schema, ns, message: writer.write_message(topic, schemas[schema], message, ns, ns)
        write("/rosout", "text", START_NS, {"data": "not read"})
        for k in range(20):
            ns = START_NS + k * 20_000_000
            write("/joint_states", "joints", ns, joints(ns, 0.02 * k, k % 3 == 1))
            half = 0.1 * k
            pose = {"position": xyz(0.1 * k, 0.0, 1.0),
                    "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}}
            if k % 2 == 0:
                write("/tool", "pose", ns, {"header": header(ns), "pose": pose})
        for k in range(45):
            # Between the other stamps; a gap of 100 ms.
            ns = START_NS - 3_000_000 + k * 10_000_000
            if not 20 <= k < 30:
                wrench = {"force": xyz(1.0 * k, 0.0, 700.0), "torque": xyz(0.0, 0.0, 0.1)}
                write("/wrench", "wrench", ns, {"header": header(ns), "wrench": wrench})
        writer.finish()


def ros_bag(folder):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    shutil.rmtree(folder, ignore_errors=True)
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    JointState, Header, Time = (kinds[k] for k in
                                ["sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"])
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", JointState.__msgtype__, typestore=store)
        for k in range(5):
            ns = START_NS + k * 10_000_000
            message = JointState(header=Header(stamp=Time(sec=ns // 10**9, nanosec=ns % 10**9), frame_id=""),
                                 name=["slider", "base"], position=np.array([0.01 * k, 1.0]),
                                 velocity=np.array([]), effort=np.array([]))
            writer.write(connection, ns, store.serialize_cdr(message, JointState.__msgtype__))


def main():
    t = np.arange(40) * 0.025
    q = np.column_stack([30 * np.sin(4 * t), 20 * np.cos(4 * t)])
    cell = lambda number: f"{number:.4f}".replace(".", ",")
    rows = [";".join([f"{1000 * x:.0f}", cell(a), cell(b), cell(12 - a / 10), "an" if k % 2 else "aus"])
            for k, (x, (a, b)) in enumerate(zip(t, q))]
    rows[7] = rows[7].rsplit(";", 2)[0] + ";;an"
    text = "% Steuerung 4711\r\nZeit [ms];Achse 1 [deg];Achse 2 [deg];Moment 1 [Nm];Ventil\r\n" + "\r\n".join(rows) + "\r\n"
    (EXAMPLES / "foreign-robot.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())

    np.savez_compressed(EXAMPLES / "foreign-arrays.npz", t=(1000 * t).astype("i4"), q=np.asfortranarray(q),
                        tau=(q / 10).astype("f4"), rate=np.array(40.0))
    log = {"t": t.reshape(1, -1), "q": np.radians(q), "sensor": {"Fz": (700 + q[:, :1]).astype("i2")}}
    scipy.io.savemat(EXAMPLES / "foreign-matlab.mat", {"log": log, "note": "made by hand"}, do_compression=True)
    ros_log(EXAMPLES / "foreign-ros2.mcap")

    np.save(HERE / "big-endian.npy", q[:5].astype(">f4"))
    np.save(HERE / "records.npy", np.array([(0.0, 1, True), (0.5, -2, False)], dtype=[("t", "f8"), ("n", "i2"), ("on", "?")]))
    two = np.zeros((2, 1), dtype=[("q", "O")])
    two["q"][:, 0] = [np.arange(3.0), np.arange(4.0)]
    scipy.io.savemat(HERE / "plain.mat", {"q": q[:3].T, "two": two, "cells": np.array([["a"]], dtype=object),
                                          "z": np.array([1 + 2j])}, do_compression=False)
    ros_bag(HERE / "bag")


main()
