//! A hand that finds its grasp: four fingertips on four contacts, with the wrist free.
//!
//! 30 degrees of freedom: six of the wrist, four joints of each finger, and two virtual ones that place the contact on the
//! spherical fingertip; 20 constraints, for a contact is a point and a direction. [`paper`] is the search of Suárez and
//! Claret with its constants, [`train`] its sequence of initial configurations, [`solve`] the method to use. Every answer
//! can be checked by another forward kinematics ([`cross_check`]).
//!
//! The palm's pose follows from the thumb's contact and the turn φ_T about its normal, so that the variables are 25 and the
//! constraints of the other three fingers 15 ([`jacobian`]).
//!
//! The paper leaves unsaid: the dimensions of its hand (the Allegro hand is used), the range of the virtual joints (a
//! quarter of a turn each, here), and how much of the rank of its 18 × 25 Jacobian there is (15).

pub mod assembly;
pub mod bare;
pub mod collision;
pub mod contact;
pub mod contacts_file;
pub mod cross_check;
pub mod fault;
pub mod file;
pub mod hand;
pub mod jacobian;
pub mod layout;
pub mod library;
pub mod paper;
pub mod picture;
pub mod plot;
pub mod solve;
pub mod train;

#[cfg(test)]
mod tests;
