//! What the commands write as HTML and SVG besides drawings: the page of a diagnosis, the density of an arm's frames.

pub(crate) mod density;
pub(crate) mod diagnosis;
