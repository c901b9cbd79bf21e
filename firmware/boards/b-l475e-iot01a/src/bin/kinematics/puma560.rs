//! Puma 560: made by `darm model --rust` from its file.

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::{BASE, Body, Link, LinkFrame, Symmetric, Tree, Turn};

/// Joints and links.
pub(crate) const TREE: Tree<f32, 6> = Tree {
    links: [
        Link {
            parent: BASE,
            kind: JointKind::Revolute,
            turn: Turn::None,
            origin: Vec3::new(0.0, 0.0, 0.67183),
            offset: 0.0,
            body: Body {
                mass: 0.0,
                moment: Vec3::new(0.0, 0.0, 0.0),
                inertia: Symmetric { xx: 0.0, xy: 0.0, yy: 1.3122898e-33, xz: 0.0, yz: 2.1431318e-17, zz: 0.35 },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
        Link {
            parent: 0,
            kind: JointKind::Revolute,
            turn: Turn::Quarter,
            origin: Vec3::new(0.0, 0.0, 0.0),
            offset: 0.0,
            body: Body {
                mass: 17.4,
                moment: Vec3::new(1.1832, 0.1044, 3.9585),
                inertia: Symmetric {
                    xx: 1.0311852,
                    xy: -0.0070992,
                    yy: 1.5050163,
                    xz: -0.269178,
                    yz: -0.023751,
                    zz: 0.620084,
                },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
        Link {
            parent: 1,
            kind: JointKind::Revolute,
            turn: Turn::None,
            origin: Vec3::new(0.4318, 0.0, 0.15005),
            offset: 0.0,
            body: Body {
                mass: 4.8,
                moment: Vec3::new(0.0, 0.336, 0.06768),
                inertia: Symmetric { xx: 0.090474285, xy: 0.0, yy: 0.013454288, xz: 0.0, yz: -0.0047376, zz: 0.10952 },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
        Link {
            parent: 2,
            kind: JointKind::Revolute,
            turn: Turn::QuarterBack,
            origin: Vec3::new(0.0203, 0.4318, 2.6440125e-17),
            offset: 0.0,
            body: Body {
                mass: 0.82,
                moment: Vec3::new(0.0, 9.539998e-19, 0.01558),
                inertia: Symmetric { xx: 0.00209602, xy: 0.0, yy: 0.00209602, xz: 0.0, yz: -4.8742167e-20, zz: 0.0013 },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
        Link {
            parent: 3,
            kind: JointKind::Revolute,
            turn: Turn::Quarter,
            origin: Vec3::new(0.0, 0.0, 0.0),
            offset: 0.0,
            body: Body {
                mass: 0.34,
                moment: Vec3::new(0.0, 0.0, 0.0),
                inertia: Symmetric { xx: 0.0003, xy: 0.0, yy: 0.0003, xz: 0.0, yz: -6.123234e-21, zz: 0.0004 },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
        Link {
            parent: 4,
            kind: JointKind::Revolute,
            turn: Turn::QuarterBack,
            origin: Vec3::new(0.0, 0.0, 0.0),
            offset: 0.0,
            body: Body {
                mass: 0.09,
                moment: Vec3::new(0.0, 0.0, 0.00288),
                inertia: Symmetric { xx: 0.00024216, xy: 0.0, yy: 0.00024216, xz: 0.0, yz: 0.0, zz: 4e-5 },
            },
            turned: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        },
    ],
    base: Body {
        mass: 0.0,
        moment: Vec3::new(0.0, 0.0, 0.0),
        inertia: Symmetric { xx: 0.0, xy: 0.0, yy: 0.0, xz: 0.0, yz: 0.0, zz: 0.0 },
    },
    gravity: Vec3::new(0.0, 0.0, -9.81),
};

/// The tool: link 6.
pub(crate) const TOOL: LinkFrame<f32> = LinkFrame {
    link: 5,
    pose: Pose { rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), position: Vec3::new(0.0, 0.0, 0.0) },
};

/// Least and greatest position of each joint, rad or m.
pub(crate) const LIMITS: [[f32; 2]; 6] = [
    [-2.7925267, 2.7925267],
    [-0.7853982, 3.9269907],
    [-3.9269907, 0.7853982],
    [-1.9198622, 2.9670596],
    [-1.7453293, 1.7453293],
    [-4.6425757, 4.6425757],
];
