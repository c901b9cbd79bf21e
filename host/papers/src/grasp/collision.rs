//! Which parts of a hand touch, and how near others come, by the robot's own convex shapes.
//!
//! Two links that a joint connects always touch and are not checked. Neither are two that touch in nearly all of a few
//! hundred random postures: their shapes overlap by construction, such as those of a motor and its bracket, and
//! [`Shapes::overlapping`] names them. All others are. The distance of a pair is that of its nearest or deepest pieces;
//! its gradient comes from the two points and the normal between them, which the solver takes as a constraint.

mod bounds;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use parry3d_f64::math::{Matrix, Pose as Placed, Rotation, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::SharedShape;

use self::bounds::{Bounds, Sphere};
use super::layout::{BODIES, Links, Pair, is_joined};
use darm_robot::shape::{Geometry, LinkShape};

/// What a body is called, and its shapes in its frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// The link.
    pub name: String,
    /// Its shapes, with those of all links that are fixed to it.
    pub shapes: Vec<LinkShape>,
}

/// A convex piece of a body.
#[derive(Clone, Debug)]
struct Piece {
    shape: SharedShape,
    /// In the frame of the body.
    pose: Placed,
    /// A sphere around it, in the frame of the body.
    sphere: Sphere,
    /// A box around it, in its own frame.
    bounds: Bounds,
}

/// The shapes of a hand, and which of them may not touch.
#[derive(Clone, Debug)]
pub struct Shapes {
    bodies: [(Sphere, Vec<Piece>); BODIES],
    /// Pairs that are checked.
    pub pairs: Vec<Pair>,
    /// Pairs that touch in nearly all postures and are not checked.
    pub overlapping: Vec<Pair>,
}

/// How near two bodies are, in the frame of the palm.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Which two.
    pub pair: Pair,
    /// Distance of their surfaces, m; below zero they overlap.
    pub distance_m: f64,
    /// The points of both that are nearest, or deepest in the other.
    pub points: [Vec3<f64>; 2],
    /// Unit vector along which the first moves away from the second.
    pub apart: Vec3<f64>,
}

impl Shapes {
    /// The shapes of bodies; pairs that a joint connects are not checked. `Err`: the link of a shape without volume.
    ///
    /// # Errors
    ///
    /// The corners of a shape are in a plane: the name of its link.
    pub fn new(bodies: &[Body; BODIES]) -> Result<Self, String> {
        let mut shapes = Self {
            bodies: std::array::from_fn(|_| (Sphere::around(&[]), Vec::new())),
            pairs: Vec::new(),
            overlapping: Vec::new(),
        };
        for ((sphere, pieces), body) in shapes.bodies.iter_mut().zip(bodies) {
            for shape in &body.shapes {
                pieces.push(Piece::new(shape).ok_or_else(|| shape.link.clone())?);
            }
            *sphere = Sphere::around(&pieces.iter().map(|piece| piece.sphere).collect::<Vec<_>>());
        }
        let has_shapes = |body: &usize| !bodies[*body].shapes.is_empty();
        let all = (0..BODIES).flat_map(|b| (0..b).map(move |a| [a, b]));
        shapes.pairs = all.filter(|pair| !is_joined(pair) && pair.iter().all(has_shapes)).collect();
        Ok(shapes)
    }

    /// Moves the pairs that touch in at least this share of postures to those that are not checked.
    pub(super) fn leave_out(&mut self, postures: &[Links], share: f64) {
        let limit = share * postures.len() as f64;
        let pairs = std::mem::take(&mut self.pairs);
        let touches = |pair: &Pair| {
            let touching = postures.iter().filter(|links| self.touch(&placed(links), pair)).count();
            touching as f64 >= limit
        };
        (self.overlapping, self.pairs) = pairs.into_iter().partition(touches);
    }

    /// Calls `visit` with each pair closer than `margin_m`.
    pub fn near(&self, links: &Links, margin_m: f64, mut visit: impl FnMut(Gap)) {
        let at = placed(links);
        for pair in &self.pairs {
            let mut nearest: Option<query::Contact> = None;
            self.close_pieces(&at, pair, margin_m, |(one, first), (other, second)| {
                // All pieces are convex, which this query is made for.
                let found = query::contact(&one, &*first.shape, &other, &*second.shape, margin_m).ok().flatten();
                nearest = found.into_iter().chain(nearest).min_by(|a, b| a.dist.total_cmp(&b.dist));
                false
            });
            if let Some(contact) = nearest {
                let points = [contact.point1, contact.point2].map(vector);
                visit(Gap { pair: *pair, distance_m: contact.dist, points, apart: vector(-contact.normal1) });
            }
        }
    }

    /// Two bodies that touch, where any do.
    pub fn collision(&self, links: &Links) -> Option<Pair> {
        let at = placed(links);
        self.pairs.iter().find(|pair| self.touch(&at, pair)).copied()
    }

    fn touch(&self, at: &[Placed; BODIES], pair: &Pair) -> bool {
        let intersect = |(one, first): (Placed, &Piece), (other, second): (Placed, &Piece)| {
            query::intersection_test(&one, &*first.shape, &other, &*second.shape)
                .map_or(true, |found| found.intersecting)
        };
        self.close_pieces(at, pair, 0.0, intersect)
    }

    /// Whether `is_enough` holds of any two pieces of a pair whose spheres and boxes are closer than the margin.
    fn close_pieces<'a>(
        &'a self,
        at: &[Placed; BODIES],
        [a, b]: &Pair,
        margin_m: f64,
        mut is_enough: impl FnMut((Placed, &'a Piece), (Placed, &'a Piece)) -> bool,
    ) -> bool {
        let ((sphere, pieces), (other_sphere, others)) = (&self.bodies[*a], &self.bodies[*b]);
        if !sphere.at(&at[*a]).is_near(&other_sphere.at(&at[*b]), margin_m) {
            return false;
        }
        pieces.iter().any(|piece| {
            let sphere = piece.sphere.at(&at[*a]);
            let place = at[*a] * piece.pose;
            let mut near = others.iter().filter(|other| sphere.is_near(&other.sphere.at(&at[*b]), margin_m));
            near.any(|other| {
                let other_place = at[*b] * other.pose;
                piece.bounds.is_near(&place, &other.bounds, &other_place, margin_m)
                    && is_enough((place, piece), (other_place, other))
            })
        })
    }
}

impl Piece {
    /// `None`: the hull of points in a plane.
    fn new(from: &LinkShape) -> Option<Self> {
        let along_z = Rotation::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let mut pose = pose(&from.pose);
        let shape = match &from.geometry {
            Geometry::Cuboid { half_m } => SharedShape::cuboid(half_m.x, half_m.y, half_m.z),
            Geometry::Sphere { radius_m } => SharedShape::ball(*radius_m),
            Geometry::Capsule { radius_m, half_m } => SharedShape::capsule_z(*half_m, *radius_m),
            Geometry::Cylinder { radius_m, half_m } => {
                // It is along y there.
                pose *= Placed::from_rotation(along_z);
                SharedShape::cylinder(*half_m, *radius_m)
            }
            Geometry::Hull(points) => {
                let points: Vec<Vector> = points.iter().map(|point| Vector::new(point.x, point.y, point.z)).collect();
                SharedShape::convex_hull(&points)?
            }
        };
        let sphere = shape.compute_bounding_sphere(&pose);
        let sphere = Sphere { center: sphere.center, radius: sphere.radius };
        let aabb = shape.compute_local_aabb();
        let bounds = Bounds { center: aabb.center(), half: aabb.half_extents() };
        Some(Self { shape, pose, sphere, bounds })
    }
}

fn placed(links: &Links) -> [Placed; BODIES] {
    std::array::from_fn(|body| links.get(body).map_or(Placed::IDENTITY, pose))
}

fn pose(from: &Pose<f64>) -> Placed {
    let rotation = Matrix::from_cols_slice(from.rotation.as_slice());
    let position = from.position;
    Placed::from_parts(Vector::new(position.x, position.y, position.z), Rotation::from_mat3(&rotation))
}

fn vector(from: Vector) -> Vec3<f64> {
    Vec3::new(from.x, from.y, from.z)
}

#[cfg(test)]
mod tests;
