"""Reference values of robot files by Pinocchio (URDF) and MuJoCo (MJCF): one JSON object per file and line.

Usage: python foreign.py FOLDER > values.jsonl

Arrays are reduced to the joints that move independently: of joints that others prescribe, q = C theta + d, so M becomes
C' M C. Rows of six have the angular part first; a floating base stands at the origin and comes before the joints.
"""

import json
import os
import random
import sys
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin

# Files of a single link that are compared; there are a thousand alike.
MAX_SINGLE = 50


def files(folder):
    """All URDF and MJCF files below the folder."""
    singles = 0
    for path, _, names in sorted(os.walk(folder)):
        for name in sorted(names):
            file = os.path.join(path, name)
            if not name.endswith((".urdf", ".xml")) or "test_assets" in file:
                continue
            with open(file, "rb") as f:
                text = f.read()
            if name.endswith(".urdf"):
                single = text.count(b"<link") == 1
                singles += single
                if not single or singles <= MAX_SINGLE:
                    yield file, "urdf"
            elif b"<mujoco" in text and b"<mujocoinclude" not in text:
                yield file, "mjcf"


def chain(name, mimics):
    """The joint that a joint follows, with factor and offset."""
    factor, offset = 1.0, 0.0
    while name in mimics:
        name, multiplier, more = mimics[name]
        offset += factor * more
        factor *= multiplier
    return name, factor, offset


def coupling(names, mimics, drawn):
    """C, the positions of all joints, and the names of the independent ones (None: a joint that is held)."""
    free = [n for n in names if n not in mimics]
    matrix, q = np.zeros((len(names), len(free))), np.zeros(len(names))
    for row, name in enumerate(names):
        other, factor, offset = chain(name, mimics)
        q[row] = offset
        if other is not None:
            matrix[row, free.index(other)] = factor
            q[row] += factor * drawn[other]
    return matrix, q, free


def of_urdf(file, rng):
    model = pin.buildModelFromUrdf(file)
    root = ET.parse(file).getroot()
    mimics = {}
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("name") in model.names:
            of = lambda key, default: float(mimic.get(key, default))
            mimics[joint.get("name")] = mimic.get("joint"), of("multiplier", 1), of("offset", 0)
    names = [n for n in model.names][1:]
    if any(joint.nv != 1 for joint in model.joints[1:]):
        raise ValueError("a joint of more than one axis")
    drawn = {n: rng.uniform(-1, 1) for n in names}
    matrix, q, free = coupling(names, mimics, drawn)
    data = model.createData()
    q = pin.integrate(model, pin.neutral(model), q)
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    gravity = pin.computeGeneralizedGravity(model, data, q)
    frames = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    jacobian = pin.computeFrameJacobian(model, data, q, frames[-1], pin.LOCAL_WORLD_ALIGNED)
    jacobian = np.vstack([jacobian[3:], jacobian[:3]])
    return {
        "joints": free,
        "q": [drawn[n] for n in free],
        "mass": (matrix.T @ mass @ matrix).tolist(),
        "gravity": (matrix.T @ gravity).tolist(),
        "frame": model.frames[frames[-1]].name,
        "jacobian": (jacobian @ matrix).tolist(),
    }


def of_mjcf(file, rng):
    model = mujoco.MjModel.from_xml_path(file)
    data = mujoco.MjData(model)
    kinds = model.jnt_type.tolist()
    is_free = mujoco.mjtJoint.mjJNT_FREE in kinds
    if kinds.count(mujoco.mjtJoint.mjJNT_FREE) > 1 or mujoco.mjtJoint.mjJNT_BALL in kinds:
        raise ValueError("more than one free joint, or a ball joint")
    if is_free and kinds[0] != mujoco.mjtJoint.mjJNT_FREE:
        raise ValueError("a joint beside a body that floats")
    numbers = [k for k, kind in enumerate(kinds) if kind != mujoco.mjtJoint.mjJNT_FREE]
    mimics = {}
    for k in range(model.neq):
        coefficients = model.eq_data[k][:5]
        if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[k] and not coefficients[2:].any():
            one, two = model.eq_obj1id[k], model.eq_obj2id[k]
            start = model.qpos0[model.jnt_qposadr[one]]
            if two < 0:
                mimics[one] = None, 1.0, start + coefficients[0]
            else:
                offset = start + coefficients[0] - coefficients[1] * model.qpos0[model.jnt_qposadr[two]]
                mimics[one] = two, coefficients[1], offset
    drawn = {k: rng.uniform(-1, 1) for k in numbers}
    matrix, q, free = coupling(numbers, mimics, drawn)
    for k, position in zip(numbers, q):
        data.qpos[model.jnt_qposadr[k]] = position
    base = 6 if is_free else 0
    if is_free:
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, mass, data.qM)
    except (TypeError, AttributeError):
        mujoco.mj_fullM(model, data, mass)
    body = model.nbody - 1
    position, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, position, rotation, body)
    order = [3, 4, 5, 0, 1, 2] if is_free else []
    order += [k for k in range(base, model.nv)]
    full = np.zeros((model.nv, base + len(free)))
    full[:base, :base] = np.eye(base)
    full[base:, base:] = matrix
    full = full[:, :]
    mass, gravity = mass[np.ix_(order, order)], data.qfrc_bias[order]
    jacobian = np.vstack([rotation, position])[:, base:]
    return {
        "joints": [model.joint(k).name or None for k in free],
        "q": [drawn[k] for k in free],
        "mass": (full.T @ mass @ full).tolist(),
        "gravity": (full.T @ gravity).tolist(),
        "frame": model.body(body).name or None,
        "jacobian": (jacobian @ matrix).tolist(),
    }


def main():
    for file, kind in files(sys.argv[1]):
        rng = random.Random(os.path.basename(file))
        out = {"file": file, "format": kind}
        try:
            out |= of_urdf(file, rng) if kind == "urdf" else of_mjcf(file, rng)
        except Exception as error:  # What the reference refuses is reported, whatever it raises.
            out["refused"] = str(error).split("\n")[0][:200] or type(error).__name__
        print(json.dumps(out), flush=True)


if __name__ == "__main__":
    main()
