//! Coulomb friction that grows or falls steadily during a session, as in a joint that warms up or a part that begins
//! to bind. For the dependence of friction on temperature see A. C. Bittencourt and S. Gunnarsson, "Static Friction
//! in a Robot Joint: Modeling and Identification of Load and Temperature Effects", *Journal of Dynamic Systems,
//! Measurement, and Control* 134(5), 2012; at its start, warming up is linear in time.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler, Simulated,
    Traits, Words, sign,
};

/// Effort (F + r t) sgn(qd), t being the time since the start of the session.
pub(super) static EFFECT: Effect = Effect {
    name: "friction_drift",
    words: Words::new(
        "Friction drift",
        "Coulomb friction that changes steadily",
        "Dry friction that grows or falls all through the session: a joint that warms up, or a bearing, seal or brake that \
         begins to bind.",
        "Joint {place}: if its friction grows, bearing, seal and brake; if it falls, the arm was cold. Record again when warm.",
        "The Coulomb friction of joint {place} is {coulomb_start_nm} at the start of the session and changes steadily, by \
         {growth_nm_per_s}. The corrected twin has the friction at the end of the recordings.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("coulomb_start_nm", 0.0),
        Parameter::any("growth_nm_per_s"),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_start_nm"),
        Coordinate::factor("growth_nm_per_s"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_start_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::No(super::export::CHANGES),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let end_s = draw.start_session_s + draw.shortest_s;
        let start = 0.2 + 0.3 * draw.share;
        let rises = draw.chance.coin();
        Drawn::new(draw.efforts_nm(), move |f| {
            let (first, last) = if rises { (start, 1.0) } else { (1.0, start) };
            vec![
                ("coulomb_start_nm", f * first),
                ("growth_nm_per_s", f * (last - first) / end_s),
            ]
        })
    }),
    traits: Traits {
        is_off_list: true,
        drifts: Some(at_session),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |drift: &[f64; 2], j, at| {
            at_session(drift, at.session_s) * sign(at.velocity[j])
        })
    },
};

/// Coulomb friction at a time of the session \[N m or N\].
fn at_session(coordinates: &[f64], session_s: f64) -> f64 {
    let [start, growth] = super::law::array(coordinates);
    start + growth * session_s
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn it_changes_with_the_session_and_turns_with_the_direction() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[2.0, -0.01]);
        for (time_s, velocity, expected) in [(0.0, 1.0, 1.0), (50.0, -1.0, -0.5)] {
            // The session began 100 s before.
            let at = sample(0.0, time_s, [0.0; 2], [velocity, 0.0], [0.0; 2]);
            let mut effort = [0.0; 2];
            term.act(&at.view(), &mut effort);
            assert!((effort[0] - expected).abs() < 1e-12 && effort[1] == 0.0);
        }
    }
}
