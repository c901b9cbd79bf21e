//! Nonlinear least squares by Levenberg and Marquardt's method.
//!
//! Minimises f(x) = Σ rₖ(x)², where the residuals r are already divided by their standard deviations. In each step
//! (JᵀJ + λ diag JᵀJ) δ = −Jᵀr; λ falls after a step that lowers f, and rises after one that does not.
//!
//! Source: D. W. Marquardt, J. SIAM 11 (1963) 431.

use nalgebra::allocator::Allocator;
use nalgebra::{Cholesky, DefaultAllocator, Dim, OMatrix, OVector};

/// A step that changes f by less than this part of it ends the search.
const CONVERGED: f64 = 1e-9;

/// λ at the start, by how much it rises or falls, and where no step can be found.
const LAMBDA: f64 = 1e-3;
const FACTOR: f64 = 10.0;
const MAX_LAMBDA: f64 = 1e10;

/// The residuals at one point, multiplied out.
#[derive(Clone, Debug)]
pub struct NormalEquations<D: Dim>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// f.
    pub cost: f64,
    /// Jᵀr.
    pub gradient: OVector<f64, D>,
    /// JᵀJ.
    pub information: OMatrix<f64, D, D>,
}

/// A point with its residuals.
pub trait Problem: Sized {
    /// Number of unknowns.
    type Size: Dim;

    /// f, Jᵀr and JᵀJ here; `None` where the residuals are not defined.
    fn normal_equations(&self) -> Option<NormalEquations<Self::Size>>
    where
        DefaultAllocator: Allocator<Self::Size> + Allocator<Self::Size, Self::Size>;

    /// The point a step away; `None` where there is none.
    fn moved(&self, step: &OVector<f64, Self::Size>) -> Option<Self>
    where
        DefaultAllocator: Allocator<Self::Size>;
}

/// The lowest point that was found.
#[derive(Clone, Debug)]
pub struct Minimum<P: Problem>
where
    DefaultAllocator: Allocator<P::Size> + Allocator<P::Size, P::Size>,
{
    /// The point.
    pub point: P,
    /// f, Jᵀr and JᵀJ there.
    pub equations: NormalEquations<P::Size>,
    /// Whether the search ended because f no longer fell.
    pub converged: bool,
}

impl<P: Problem> Minimum<P>
where
    DefaultAllocator: Allocator<P::Size> + Allocator<P::Size, P::Size>,
{
    /// (JᵀJ)⁻¹, the covariance of the unknowns; `None` where they are not determined.
    pub fn covariance(&self) -> Option<OMatrix<f64, P::Size, P::Size>> {
        Cholesky::new(self.equations.information.clone()).map(|factor| factor.inverse())
    }
}

/// Searches a minimum near a point; `None` where its residuals are not defined.
pub fn minimise<P: Problem>(start: P, max_steps: usize) -> Option<Minimum<P>>
where
    DefaultAllocator: Allocator<P::Size> + Allocator<P::Size, P::Size>,
{
    let equations = start.normal_equations().filter(|equations| equations.cost.is_finite())?;
    let mut best = Minimum { point: start, equations, converged: false };
    let mut lambda = LAMBDA;
    for _ in 0..max_steps {
        match lower(&best, lambda) {
            Some((point, equations)) => {
                let fall = best.equations.cost - equations.cost;
                let converged = fall <= CONVERGED * best.equations.cost;
                best = Minimum { point, equations, converged };
                lambda /= FACTOR;
            }
            // At the minimum rounding keeps f from falling.
            None if lambda > MAX_LAMBDA => best.converged = true,
            None => lambda *= FACTOR,
        }
        if best.converged {
            break;
        }
    }
    Some(best)
}

/// A damped step, if f falls.
fn lower<P: Problem>(from: &Minimum<P>, lambda: f64) -> Option<(P, NormalEquations<P::Size>)>
where
    DefaultAllocator: Allocator<P::Size> + Allocator<P::Size, P::Size>,
{
    let mut damped = from.equations.information.clone();
    for k in 0..damped.nrows() {
        damped[(k, k)] *= 1.0 + lambda;
    }
    let step = -Cholesky::new(damped)?.solve(&from.equations.gradient);
    let point = from.point.moved(&step)?;
    let equations = point.normal_equations()?;
    (equations.cost <= from.equations.cost).then_some((point, equations))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, U2, Vector2};

    use super::{NormalEquations, Problem, minimise};

    /// Rosenbrock's valley: r = (10 (y − x²), 1 − x), with its minimum at (1, 1).
    struct Valley(Vector2<f64>);

    impl Problem for Valley {
        type Size = U2;

        fn normal_equations(&self) -> Option<NormalEquations<U2>> {
            let Self(at) = self;
            let residual = Vector2::new(10.0 * (at.y - at.x * at.x), 1.0 - at.x);
            let jacobian = Matrix2::new(-20.0 * at.x, 10.0, -1.0, 0.0);
            let (gradient, information) = (jacobian.transpose() * residual, jacobian.transpose() * jacobian);
            Some(NormalEquations { cost: residual.norm_squared(), gradient, information })
        }

        fn moved(&self, step: &Vector2<f64>) -> Option<Self> {
            Some(Self(self.0 + step))
        }
    }

    #[test]
    fn the_end_of_a_curved_valley_is_found() {
        let minimum = minimise(Valley(Vector2::new(-1.2, 1.0)), 100).unwrap();
        assert!(minimum.converged && (minimum.point.0 - Vector2::new(1.0, 1.0)).norm() < 1e-6);
    }

    #[test]
    fn a_point_without_residuals_has_no_minimum() {
        assert!(minimise(Valley(Vector2::new(f64::NAN, 1.0)), 100).is_none());
    }
}
