//! Stage 3: which effects predict rows that no fit has seen better than the model without them.

pub mod backward;
mod change_point;
pub mod cross_validation;
mod design_matrix;
pub(crate) mod factored;
pub mod forward;
mod normal_equations;
pub mod problem;
pub mod robust_fit;
pub mod search;
mod signal_search;
pub mod signals;
pub mod significance;
pub mod simplify;
pub mod tool_pose;
