//! Colours, with the same meaning in every plot.

use rerun::Rgba32;
use tauscope_dynamics::terms::{
    COULOMB_FRICTION, Effect, PAYLOAD, TORQUE_BIAS, TORQUE_GAIN, UNKNOWN, VISCOUS_FRICTION,
};

/// Measured effort.
pub(super) const MEASURED: Rgba32 = Rgba32::from_rgb(86, 156, 238);
/// Expected effort of the twin.
pub(super) const EXPECTED: Rgba32 = Rgba32::from_rgb(255, 176, 66);
/// Expected effort of a corrected twin, and its residual.
pub(super) const CORRECTED: Rgba32 = Rgba32::from_rgb(0, 200, 140);
/// Interval in which an effect acts on the arm.
pub(super) const EVENT: Rgba32 = Rgba32::from_rgb(204, 121, 167);
/// Interval in which it does not.
pub(super) const QUIET: Rgba32 = Rgba32::from_rgb(44, 50, 58);
/// Residual.
pub(super) const RESIDUAL: Rgba32 = Rgba32::from_rgb(214, 102, 168);
/// Score of a detector.
pub(super) const SCORE: Rgba32 = Rgba32::from_rgb(94, 200, 178);
/// Contact: threshold, touched link, force and state.
pub(super) const CONTACT: Rgba32 = Rgba32::from_rgb(232, 76, 76);
/// Axes x, y and z.
pub(super) const AXES: [Rgba32; 3] = [
    Rgba32::from_rgb(255, 128, 110),
    Rgba32::from_rgb(130, 220, 120),
    Rgba32::from_rgb(120, 180, 255),
];
/// Direction in which a force rose.
pub(super) const RISE: Rgba32 = Rgba32::from_rgb(255, 176, 66);
/// Direction in which the tool moved.
pub(super) const MOTION: Rgba32 = Rgba32::from_rgb(86, 156, 238);
/// Change of the arm.
const CHANGE: Rgba32 = Rgba32::from_rgb(232, 148, 58);
/// Link.
pub(super) const LINK: Rgba32 = Rgba32::from_rgb(176, 184, 196);
/// Every second link, to distinguish adjacent links.
pub(super) const OTHER_LINK: Rgba32 = Rgba32::from_rgb(122, 132, 148);

/// Background of the robot.
pub(super) const BACKGROUND: Rgba32 = Rgba32::from_rgb(22, 25, 30);
/// Grid of the floor.
pub(super) const GRID: Rgba32 = Rgba32::from_unmultiplied_rgba(150, 160, 175, 40);

/// Label and colour of each detector state, as (state, label, colour).
pub(super) static STATES: [(&str, &str, Rgba32); 11] = [
    ("not_ready", "not ready", Rgba32::from_rgb(96, 100, 108)),
    ("free", "free", Rgba32::from_rgb(58, 132, 84)),
    ("contact", "contact", CONTACT),
    ("cooperation", "cooperation", Rgba32::from_rgb(78, 118, 196)),
    ("collision", "collision", Rgba32::from_rgb(176, 30, 96)),
    change(&COULOMB_FRICTION, COULOMB_FRICTION.words.noun),
    change(&VISCOUS_FRICTION, VISCOUS_FRICTION.words.noun),
    change(&TORQUE_GAIN, TORQUE_GAIN.words.noun),
    change(&TORQUE_BIAS, TORQUE_BIAS.words.noun),
    change(&PAYLOAD, PAYLOAD.name),
    change(&UNKNOWN, "no name fits"),
];

const fn change(effect: &Effect, label: &'static str) -> (&'static str, &'static str, Rgba32) {
    (effect.name, label, CHANGE)
}
