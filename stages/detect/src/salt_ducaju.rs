//! Salt Ducaju, Olofsson, Robertsson and Johansson, "Fast Contact Detection and Classification for
//! Kinesthetic Teaching in Robots using only Embedded Sensors", RO-MAN 2022.
//!
//! Detects contacts in a twin's samples of an arm under Cartesian impedance control (equation 1), and classifies them
//! as collisions or cooperations.
//!
//! - [`contact_signals`]: external force at the tool (equation 9: [`wrench`]), its spectrum over a sliding window
//!   ([`sliding_dft`], section II-B) and the tool's velocity.
//! - [`contact_machine`]: Algorithm 1 and condition (4), the start and end of a contact.
//! - [`contact_classifier`]: Algorithm 2, conditions (5) and (6); [`fisher_discriminant`] and
//!   [`frequency_classifier`] are the alternatives of section V. [`contact_tuning`] tunes all three on labelled
//!   recordings.

pub mod contact_classifier;
pub mod contact_machine;
pub mod contact_signals;
pub mod contact_tuning;
pub mod fisher_discriminant;
pub mod frequency_classifier;
pub mod sliding_dft;
pub mod wrench;
