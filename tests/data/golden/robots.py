"""Writes robots.json.gz: robot files with what Pinocchio 4.1.0 (URDF) and MuJoCo 4.0.0 (MJCF) compute from them.

Of a mass matrix of more than 40 rows only their sums are kept.

Usage: python robots.py SITE_PACKAGES, with pin, mujoco and gymnasium installed. Models of gymnasium 1.4.0: MIT licence,
Farama Foundation. The others are of this project.
"""

import gzip
import json
import os
import random
import sys
import tempfile

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.join(here, "../../..")
sys.path.insert(0, os.path.join(root, "eval/src/bench"))
import foreign  # noqa: E402

LINK = (
    '<link name="l{k}"><inertial><origin xyz="0.01 0.02 {c}" rpy="0.1 0.2 0.3"/><mass value="{m}"/>'
    '<inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="0.003" izz="0.025"/></inertial></link>\n'
)
JOINT = (
    '<joint name="j{k}" type="{type}"><origin xyz="0.1 {y} 0" rpy="{r} 0.2 0"/><parent link="l{p}"/>'
    '<child link="l{k}"/><axis xyz="{axis}"/><limit lower="-2" upper="2" effort="1" velocity="1"/>{more}</joint>\n'
)


def chain(count, more=lambda k: ""):
    """Links in series, about changing axes; every fifth joint slides."""
    axes = ["0 0 1", "0 1 0", "1 0 0", "1 1 0"]
    text = '<robot name="chain"><link name="l0"/>\n'
    for k in range(1, count + 1):
        text += LINK.format(k=k, c=0.05 * (k % 3), m=0.2 + 0.01 * k)
        kind = "prismatic" if k % 5 == 0 else "revolute"
        text += JOINT.format(k=k, p=k - 1, type=kind, y=0.02 * (k % 2), r=0.3 * (k % 4), axis=axes[k % 4], more=more(k))
    return text + "</robot>"


def mimic(k):
    """Joint 3 follows 2, 4 follows 3, 6 follows 1."""
    of = {3: ("j2", 0.5, 0.1), 4: ("j3", -2.0, 0.2), 6: ("j1", 1.5, 0.0)}.get(k)
    return '<mimic joint="{}" multiplier="{}" offset="{}"/>'.format(*of) if of else ""


ELLIPSOID = """<robot name="visuals"><link name="l0"><visual><geometry><ellipsoid radii="1 2 3"/></geometry></visual></link>
<link name="l1"><visual><geometry><mesh/></geometry><material><texture/></material></visual>
<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j1" type="continuous"><parent link="l0"/><child link="l1"/><axis xyz="0 3 0"/></joint></robot>"""

MESH = """<mujoco model="mesh"><compiler angle="radian" eulerseq="XYZ" boundinertia="0.001"/>
<default><default class="part"><joint armature="0.1"/><geom density="500"/></default></default>
<asset><mesh name="wedge" scale="1 1 -1" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset>
<worldbody><frame euler="0.1 0.2 0.3" pos="0 0 1"><body name="a" childclass="part">
<joint name="one" axis="1 2 0" pos="0.1 0 0" ref="0.3"/><joint name="two" type="slide" axis="0 0 1" ref="0.2"/>
<geom type="mesh" mesh="wedge" xyaxes="1 1 0 0 1 0"/><geom type="ellipsoid" size="0.1 0.2 0.3" zaxis="1 0 1" mass="3"/>
<body name="b" pos="0 0 0.5" axisangle="0 1 0 0.5"><joint name="three" pos="0 0.1 0"/>
<inertial pos="0.1 0 0" mass="1" fullinertia="0.1 0.2 0.15 0.01 0.02 0.03"/><geom size="1"/></body></body></frame>
</worldbody></mujoco>"""


def models(packages):
    for name in ["ant", "half_cheetah", "hopper", "humanoid", "reacher", "walker2d_v5"]:
        with open(os.path.join(packages, "gymnasium/envs/mujoco/assets", name + ".xml")) as f:
            yield name, "mjcf", f.read()
    with open(os.path.join(root, "examples/finger.xml")) as f:
        yield "finger", "mjcf", f.read()
    yield "mesh", "mjcf", MESH
    yield "mimic", "urdf", chain(7, mimic)
    yield "snake", "urdf", chain(80)
    with open(os.path.join(root, "tests/data/urdf/panda.urdf")) as f:
        yield "panda", "urdf", f.read()


def main():
    found = []
    for name, kind, text in models(sys.argv[1]):
        with tempfile.NamedTemporaryFile("w", suffix="." + kind) as file:
            file.write(text)
            file.flush()
            values = (foreign.of_urdf if kind == "urdf" else foreign.of_mjcf)(file.name, random.Random(name))
        if len(values["joints"]) > 40:
            values["mass_sums"] = [sum(row) for row in values.pop("mass")]
        found.append({"name": name, "format": kind, "text": text} | values)
    found.append({"name": "ellipsoid", "format": "urdf", "text": ELLIPSOID, "joints": ["j1"], "q": [0.5]})
    found[-1] |= {"mass": [[1.0]], "gravity": [0.0], "frame": "l1", "jacobian": [[0], [1], [0], [0], [0], [0]]}
    with gzip.GzipFile(os.path.join(here, "robots.json.gz"), "wb", mtime=0) as file:
        file.write(json.dumps(found).encode())


if __name__ == "__main__":
    main()
