//! Salt Ducaju, Olofsson, Robertsson and Johansson, "Fast Contact Detection and Classification for
//! Kinesthetic Teaching in Robots using only Embedded Sensors", RO-MAN 2022.

pub mod contact_classifier;
pub mod contact_machine;
pub mod contact_signals;
pub mod contact_tuning;
pub mod fisher_discriminant;
pub mod frequency_classifier;
pub mod sliding_dft;
pub mod wrench;
