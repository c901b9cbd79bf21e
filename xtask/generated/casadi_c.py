"""Writes C for one robot with CasADi: kinematics with Jacobian, inverse dynamics, mass matrix.

Arguments: a golden file of the robot (tests/data/golden), the folder for the C. The textbook's equations are written here
in CasADi's symbols, with the numbers of the robot as constants, and CasADi removes common subexpressions: nothing of darm is
used. Rotations, places and inertias are sparse, so that products with zeros are gone.
"""

import gzip
import json
import sys
from pathlib import Path

import casadi as ca
import numpy as np

# What is nearer to 0, 1 or -1 is a rounding of it. The angles of the UR10's file are printed to 1e-10 and stay as they are.
ROUNDING = 1e-12


def constant(matrix):
    matrix = np.array(matrix, float)
    for exact in (0.0, 1.0, -1.0):
        matrix[abs(matrix - exact) < ROUNDING] = exact
    return ca.SX(ca.sparsify(ca.DM(matrix)))


def column(values):
    return constant(np.array(values, float)[:, None])


def cross(a, b):
    return ca.vertcat(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def about_axis(axis, q):
    """The rotation by q about a coordinate axis."""
    axis = np.round(axis)
    k = int(np.argmax(abs(axis)))
    assert abs(axis[k]) == 1 and abs(axis).sum() == 1, axis
    cosine, sine = ca.cos(q), ca.sin(q) * axis[k]
    a, b = (k + 1) % 3, (k + 2) % 3
    turn = ca.SX(3, 3)
    turn[k, k], turn[a, a], turn[b, b], turn[a, b], turn[b, a] = 1, cosine, cosine, -sine, sine
    return turn


def body(link):
    """Mass, first moment, and inertia about the joint."""
    mass, com = link["m"], np.array(link["com"])
    inertia = np.array(link["I_com"]) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return ca.SX(mass), column(mass * com), constant(inertia)


class Robot:
    def __init__(self, file):
        joints = file["joints"]
        for index, joint in enumerate(joints):
            assert joint["type"] == "revolute" and (joint["parent"] == index - 1 or index == 0)
        self.n = len(joints)
        self.q, self.qd, self.qdd = (ca.SX.sym(name, self.n) for name in ("q", "qd", "qdd"))
        self.turns = [
            constant(joint["placement"]["R"]) @ about_axis(np.array(joint["axis"]), self.q[index])
            for index, joint in enumerate(joints)
        ]
        self.places = [column(joint["placement"]["p"]) for joint in joints]
        self.axes = [column(np.round(joint["axis"])) for joint in joints]
        self.bodies = [body(joint["link"]) for joint in joints]
        self.end = constant(file["ee"]["R"]), column(file["ee"]["p"])
        self.gravity = column(file["gravity_field"])

    def kinematics(self):
        """Rotation (by columns) and position of the end, and its Jacobian, angular rows first, by columns."""
        turn, place, axes, places = constant(np.eye(3)), column([0, 0, 0]), [], []
        for joint in range(self.n):
            place = place + turn @ self.places[joint]
            turn = turn @ self.turns[joint]
            axes.append(turn @ self.axes[joint])
            places.append(place)
        rotation, position = turn @ self.end[0], place + turn @ self.end[1]
        columns = [ca.vertcat(axis, cross(axis, position - place)) for axis, place in zip(axes, places)]
        return [ca.vec(rotation), position, ca.horzcat(*columns)]

    def inverse_dynamics(self):
        """Newton and Euler, outwards and inwards, in the frames of the links."""
        zero = column([0, 0, 0])
        angular, angular_rate, acceleration = zero, zero, -self.gravity
        forces, moments = [], []
        for joint in range(self.n):
            place, axis, back = self.places[joint], self.axes[joint], self.turns[joint].T
            acceleration = acceleration + cross(angular_rate, place) + cross(angular, cross(angular, place))
            own = axis * self.qd[joint]
            carried = back @ angular
            angular_rate = back @ angular_rate + axis * self.qdd[joint] + cross(carried, own)
            angular, acceleration = carried + own, back @ acceleration
            mass, first, inertia = self.bodies[joint]
            forces.append(mass * acceleration + cross(angular_rate, first) + cross(angular, cross(angular, first)))
            moments.append(
                inertia @ angular_rate + cross(angular, inertia @ angular) + cross(first, acceleration)
            )
        torques, force, moment = [None] * self.n, zero, zero
        for joint in reversed(range(self.n)):
            force, moment = forces[joint] + force, moments[joint] + moment
            torques[joint] = self.axes[joint].T @ moment
            force = self.turns[joint] @ force
            moment = self.turns[joint] @ moment + cross(self.places[joint], force)
        return [ca.vertcat(*torques)]

    def mass_matrix(self):
        """Composite bodies in the frames of the links."""
        matrix, one = ca.SX(self.n, self.n), ca.SX.eye(3)
        mass, first, inertia = self.bodies[-1]
        for joint in reversed(range(self.n)):
            moment, force = inertia @ self.axes[joint], cross(self.axes[joint], first)
            matrix[joint, joint] = self.axes[joint].T @ moment
            for carrier in reversed(range(joint)):
                force = self.turns[carrier + 1] @ force
                moment = self.turns[carrier + 1] @ moment + cross(self.places[carrier + 1], force)
                entry = self.axes[carrier].T @ moment
                matrix[carrier, joint], matrix[joint, carrier] = entry, entry
            if joint > 0:
                place, turn = self.places[joint], self.turns[joint]
                first, inertia = turn @ first, turn @ inertia @ turn.T
                twice = place @ first.T
                shift = 2 * ca.dot(place, first) * one - twice - twice.T
                steiner = mass * (ca.dot(place, place) * one - place @ place.T)
                own_mass, own_first, own_inertia = self.bodies[joint - 1]
                first = own_first + first + mass * place
                inertia = own_inertia + inertia + shift + steiner
                mass = own_mass + mass
        return [matrix]


def main():
    golden, folder = Path(sys.argv[1]), Path(sys.argv[2])
    name = golden.name.split(".")[0]
    with gzip.open(golden) as file:
        robot = Robot(json.load(file))
    motion = [robot.q, robot.qd, robot.qdd]
    functions = [
        ("kinematics", motion[:1], robot.kinematics()),
        ("inverse_dynamics", motion, robot.inverse_dynamics()),
        ("mass_matrix", motion[:1], robot.mass_matrix()),
    ]
    generator = ca.CodeGenerator(f"{name}.c", {"mex": False})
    for function, arguments, results in functions:
        dense = [ca.densify(result) for result in results]
        generator.add(ca.Function(f"{name}_{function}", arguments, ca.cse(dense)))
    generator.generate(f"{folder}/")


main()
