//! Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin System".

pub mod learned;
pub mod lstm_momentum_observer;
pub mod momentum_observer;
pub mod naive_difference;
pub mod point_autoencoder;
pub mod point_ocsvm;
pub mod twin_regression;
pub mod window_autoencoder;
pub mod window_ocsvm;
