//! Host tools of discretely actuated arms.
