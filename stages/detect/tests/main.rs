//! All tests of the public interface in one program, because linking dominates the build time.

mod common;
mod contact_classifier;
mod contact_machine;
mod kinematic_tree;
mod learned;
mod momentum;
mod momentum_observer;
mod shared;
mod stage;
mod tauscope;
mod tauscope_late;
mod tauscope_place;
mod tauscope_standing;
mod tauscope_usual;
mod virtual_collision_sensor;
