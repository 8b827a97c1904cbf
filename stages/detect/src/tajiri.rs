//! Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin System".
//!
//! Input is the twin's residual (equations 3 to 6) or the external torques of the
//! [momentum observer](crate::frame::momentum) (equation 2), output a score per sample. The alarm is raised at mean +
//! k standard deviations of the score on contact-free data (equation 7).
//!
//! - [`twin_regression`]: the paper's own method, equations 5 to 7.
//! - [`naive_difference`], [`momentum_observer`]: the compared methods without learning, section IV-B 1 and 2.
//! - [`point_ocsvm`], [`point_autoencoder`], [`lstm_momentum_observer`], [`window_ocsvm`], [`window_autoencoder`]:
//!   the compared learned methods, section IV-B 3 to 7, on inputs scaled by equation 8; [`learned`] has their common
//!   parts.

pub mod learned;
pub mod lstm_momentum_observer;
pub mod momentum_observer;
pub mod naive_difference;
pub mod point_autoencoder;
pub mod point_ocsvm;
pub mod twin_regression;
pub mod window_autoencoder;
pub mod window_ocsvm;
