"""Which postures of a hand collide, by MuJoCo: its reader, its forward kinematics, and its collision detection.

Usage: python check.py QUESTION.json

The question has the file of the robot, names of joints, postures (a list of angles each, rad), and pairs of bodies that
are not checked. Printed is a JSON list with, for each posture, the deepest overlap in m (0: none) and the two bodies.
Bodies that a joint connects are not checked either; the shapes are those of the file, all of them.
"""

import json
import sys

import mujoco


def model(path):
    spec = mujoco.MjSpec.from_file(path)
    # Inertia and contact filters of the file do not matter here.
    spec.compiler.balanceinertia = True
    for exclude in list(spec.excludes):
        spec.delete(exclude)
    model = spec.compile()
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    model.geom_contype[:] = collides
    model.geom_conaffinity[:] = collides
    model.geom_margin[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    return model


def main():
    with open(sys.argv[1]) as file:
        question = json.load(file)
    m = model(question["robot"])
    data = mujoco.MjData(m)
    addresses = [m.joint(name).qposadr[0] for name in question["joints"]]

    def fixed_to(body):
        return m.body_weldid[body]

    def number(name):
        # The base of a URDF is the world.
        named = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_BODY, name)
        return fixed_to(named) if named >= 0 else 0

    skipped = {frozenset(map(number, pair)) for pair in question["unchecked"]}

    def on(body):
        return fixed_to(m.body_parentid[body])

    def is_checked(a, b):
        joined = a == b or on(a) == b or on(b) == a
        return not joined and frozenset((a, b)) not in skipped

    found = []
    for posture in question["postures"]:
        data.qpos[addresses] = posture
        mujoco.mj_kinematics(m, data)
        mujoco.mj_comPos(m, data)
        mujoco.mj_collision(m, data)
        deepest = (0.0, None)
        for contact in data.contact:
            a, b = (fixed_to(m.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
            if contact.dist < deepest[0] and is_checked(a, b):
                deepest = (contact.dist, [m.body(a).name, m.body(b).name])
        found.append([-deepest[0], deepest[1]])
    json.dump(found, sys.stdout)


main()
