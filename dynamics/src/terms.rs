//! The physics that a rigid-body twin leaves out, each term written once: the twin adds it, the
//! simulated cell suffers it.
//!
//! A term is one file with an [`Effect`] that describes it and a [`Term`] that computes it; it is
//! known once it stands in [`EFFECTS`]. Names and parameters are canonical: files and reports hold
//! them.

mod coulomb_friction;
mod spec;
mod viscous_friction;
mod words;

pub use spec::{TermError, TermSpec};

/// Every effect there is.
pub static EFFECTS: &[&Effect] = &[&coulomb_friction::EFFECT, &viscous_friction::EFFECT];

/// The effect of that canonical name.
pub fn effect(name: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.name == name)
}

/// What there is to know of a term without its numbers.
#[derive(Debug)]
pub struct Effect {
    /// Canonical name.
    pub name: &'static str,
    /// Its parameters, in the order of the values that `build` takes.
    pub parameters: &'static [Parameter],
    /// Makes the term for a joint, by its index in URDF order, from the values of all parameters.
    build: fn(usize, &[f64]) -> Box<dyn Term>,
}

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Canonical name, with its unit.
    pub name: &'static str,
    /// How it enters.
    pub role: Role,
    /// The least value that is physically possible.
    pub minimum: f64,
}

/// How a parameter enters the effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// As a factor: the effort with this parameter 1 and the other factors 0 is its regressor column.
    Factor,
    /// In any other way.
    Shape,
}

/// One instant of a motion; slices hold one number per joint in URDF order.
#[derive(Debug, Clone, Copy)]
pub struct MotionSample<'a> {
    /// Time since the sample before \[s\]; 0 for the first and for a repeated stamp.
    pub dt_s: f64,
    /// Position \[rad or m\].
    pub position: &'a [f64],
    /// Velocity \[rad/s or m/s\].
    pub velocity: &'a [f64],
    /// Acceleration \[rad/s² or m/s²\].
    pub acceleration: &'a [f64],
}

/// One piece of physics with its numbers, at one place of one robot.
///
/// What it does is told as effort of the motor: friction that holds a joint back by 4 N m costs
/// +4 N m while the joint moves forward. The torque on the joint is the opposite.
pub trait Term: std::fmt::Debug + Send {
    /// What it is.
    fn effect(&self) -> &'static Effect;

    /// The joint it is in, an index in URDF order.
    fn joint(&self) -> usize;

    /// The values of its parameters, in the effect's order.
    fn values(&self) -> &[f64];

    /// The same, to be changed. Limits are not checked here; see [`set`].
    fn values_mut(&mut self) -> &mut [f64];

    /// Adds to `effort` (per joint in URDF order) what this term costs at this instant, given all that
    /// came before it; to be called once per sample. Does not allocate.
    fn add_effort(&mut self, at: &MotionSample, effort: &mut [f64]);

    /// What it says of a joint, e.g. `Joint elbow has Coulomb friction of 4.1 N m.`
    fn sentence(&self, joint: &str) -> String;
}

/// The value of a parameter, if the term has it.
pub fn get(term: &dyn Term, parameter: &str) -> Option<f64> {
    let index = term
        .effect()
        .parameters
        .iter()
        .position(|p| p.name == parameter)?;
    term.values().get(index).copied()
}

/// Sets a parameter.
///
/// # Errors
/// If the term does not have it, or the value is not finite or below what is possible; the term is
/// left as it was.
pub fn set(term: &mut dyn Term, parameter: &str, value: f64) -> Result<(), TermError> {
    let effect = term.effect();
    let index = effect.check(parameter, value)?;
    term.values_mut()[index] = value;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effort(term: &mut dyn Term, velocity: f64) -> f64 {
        let (q, qd, qdd) = ([0.0, 0.2], [0.0, velocity], [0.0, 0.5]);
        let at = MotionSample {
            dt_s: 0.001,
            position: &q,
            velocity: &qd,
            acceleration: &qdd,
        };
        let mut effort = [10.0, 20.0];
        term.add_effort(&at, &mut effort);
        assert_eq!(effort[0], 10.0, "only the term's own joint is touched");
        effort[1] - 20.0
    }

    #[test]
    fn what_is_called_a_factor_is_one() {
        for effect in EFFECTS {
            let ones = vec![1.0; effect.parameters.len()];
            for (index, parameter) in effect.parameters.iter().enumerate() {
                if parameter.role == Role::Shape {
                    continue;
                }
                let mut column = vec![0.0; ones.len()];
                column[index] = 1.0;
                let unit = effort(&mut *(effect.build)(1, &column), 0.7);
                assert!(
                    unit != 0.0,
                    "{}: {} does nothing",
                    effect.name,
                    parameter.name
                );
                let mut more = ones.clone();
                more[index] = 3.5;
                let change = effort(&mut *(effect.build)(1, &more), 0.7)
                    - effort(&mut *(effect.build)(1, &ones), 0.7);
                assert!((change - 2.5 * unit).abs() < 1e-12, "{}", effect.name);
            }
        }
    }

    #[test]
    fn friction_costs_effort_in_the_direction_of_motion() {
        for effect in EFFECTS
            .iter()
            .filter(|effect| effect.name.contains("friction"))
        {
            let ones = vec![1.0; effect.parameters.len()];
            let mut term = (effect.build)(1, &ones);
            assert!(effort(&mut *term, 0.4) > 0.0, "{}", effect.name);
            assert!(effort(&mut *term, -0.4) < 0.0, "{}", effect.name);
        }
    }

    #[test]
    fn names_are_unique_and_found() {
        for one in EFFECTS {
            assert!(std::ptr::eq(effect(one.name).unwrap(), *one));
        }
        assert!(effect("viscous friction").is_none());
    }

    #[test]
    fn parameters_are_got_and_set_by_name() {
        let mut term = (viscous_friction::EFFECT.build)(0, &[3.0]);
        assert_eq!(get(&*term, "viscous_nms_per_rad"), Some(3.0));
        assert_eq!(get(&*term, "coulomb_nm"), None);
        set(&mut *term, "viscous_nms_per_rad", 4.5).unwrap();
        assert_eq!(get(&*term, "viscous_nms_per_rad"), Some(4.5));
        assert!(set(&mut *term, "viscous_nms_per_rad", -1.0).is_err());
        assert!(set(&mut *term, "viscous_nms_per_rad", f64::NAN).is_err());
        assert!(set(&mut *term, "viscous", 1.0).is_err());
        assert_eq!(term.values(), [4.5]);
    }
}
