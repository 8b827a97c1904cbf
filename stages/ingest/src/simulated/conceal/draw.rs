//! Random draw of an effect: its place, and the parameters that the effect draws there.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use tauscope_dynamics::terms::{
    self, Chance, Draw, Drawn, EFFECTS, Effect, Family, Layer, PlaceKind, TermSpec,
};

use super::fit_count;
use super::plan::Plan;

/// Returns the effects that can be drawn.
pub(super) fn drawn() -> impl Iterator<Item = &'static Effect> {
    let all = EFFECTS.iter().copied();
    all.filter(|effect| effect.concealed.is_some())
}

/// An effect at a place, whose size is still open.
pub(super) struct Candidate {
    place: TermSpec,
    drawn: Drawn,
}

impl Candidate {
    /// Smallest and largest size.
    pub fn sizes(&self) -> [f64; 2] {
        self.drawn.sizes
    }

    /// Returns the term of this size.
    pub fn term(&self, size: f64) -> TermSpec {
        let parameters = (self.drawn.parameters)(size).into_iter();
        TermSpec {
            parameters: parameters
                .map(|(name, value)| (name.to_owned(), rounded(value)))
                .collect(),
            ..self.place.clone()
        }
    }
}

/// Rounds to four significant digits.
pub(super) fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let digits = 10.0_f64.powi(3 - value.abs().log10().floor() as i32);
    (value * digits).round() / digits
}

/// Random numbers of a seed.
struct Numbers<'r>(&'r mut ChaCha8Rng);

impl Chance for Numbers<'_> {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.random::<f64>()
    }

    fn whole(&mut self, least: u32, most: u32) -> u32 {
        self.0.random_range(least..=most)
    }

    fn coin(&mut self) -> bool {
        self.0.random::<bool>()
    }
}

/// Draws an effect at a random place; `None` if the effect is impossible there.
///
/// Several effects use the same numbers: a share, a direction and a sign. They are drawn in this order until the turn
/// of the effect, so that the draw of a seed does not depend on which effects exist.
pub(super) fn candidate(
    effect: &'static Effect,
    plan: &Plan,
    rng: &mut ChaCha8Rng,
) -> Option<Candidate> {
    let site = Site::draw(plan, rng)?;
    let place = site.place(effect, plan);
    let moves = plan.fastest[site.joint] > 0.0;
    let mut fixed = Fixed::default();
    if moves {
        fixed.share = rng.random();
    }
    let is_friction = matches!(effect.family, Family::PlainFriction | Family::Friction);
    for turn in [Turn::Joint, Turn::Body, Turn::Record] {
        match turn {
            Turn::Joint => {}
            Turn::Body => fixed.direction = UnitSphere.sample(rng),
            Turn::Record => fixed.sign = if rng.random::<bool>() { 1.0 } else { -1.0 },
        }
        if turn == Turn::of(effect)
            && (moves || !is_friction)
            && let Some(drawn) = site.candidate(effect, plan, fixed, rng)
        {
            return Some(Candidate { place, drawn });
        }
    }
    None
}

/// Turn in which an effect's own numbers are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    Joint,
    Body,
    Record,
}

impl Turn {
    fn of(effect: &Effect) -> Self {
        match effect.layer {
            Layer::Joint => Self::Joint,
            Layer::Body if effect.splits_joint() => Self::Joint,
            Layer::Body => Self::Body,
            Layer::Record => Self::Record,
        }
    }
}

/// Random numbers that several effects use.
#[derive(Clone, Copy)]
struct Fixed {
    share: f64,
    direction: [f64; 3],
    sign: f64,
}

impl Default for Fixed {
    fn default() -> Self {
        Self {
            share: 0.0,
            direction: [0.0; 3],
            sign: 1.0,
        }
    }
}

/// A joint, its neighbour, and a link that moves.
struct Site {
    joint: usize,
    source: usize,
    link: usize,
    /// A recording that may be fitted.
    recording: usize,
}

impl Site {
    fn draw(plan: &Plan, rng: &mut ChaCha8Rng) -> Option<Self> {
        let n = plan.joints.len();
        if n == 0 || plan.durations_s.is_empty() {
            return None;
        }
        let joint = rng.random_range(0..n);
        let next = joint + 1 < n && (joint == 0 || rng.random::<bool>());
        let of_link = rng.random_range(0..n);
        Some(Self {
            joint,
            source: if next {
                joint + 1
            } else {
                joint.saturating_sub(1)
            },
            link: plan.model.joints()[of_link].child_link,
            recording: rng.random_range(0..fit_count(plan.durations_s.len())),
        })
    }

    fn place(&self, effect: &Effect, plan: &Plan) -> TermSpec {
        let joint = |j: usize| Some(plan.joints[j].name.clone());
        let mut spec = TermSpec {
            effect: effect.name.to_owned(),
            ..TermSpec::default()
        };
        match effect.place {
            PlaceKind::Joint => spec.joint = joint(self.joint),
            PlaceKind::TwoJoints => {
                spec.joint = joint(self.joint);
                spec.source_joint = joint(self.source);
            }
            PlaceKind::Link => {
                spec.link = Some(plan.model.links()[self.link].name.clone());
            }
            PlaceKind::Tool | PlaceKind::Base | PlaceKind::All => {}
        }
        spec
    }

    fn candidate(
        &self,
        effect: &Effect,
        plan: &Plan,
        fixed: Fixed,
        rng: &mut ChaCha8Rng,
    ) -> Option<Drawn> {
        let (n, j) = (plan.joints.len(), self.joint);
        let instants = plan.instants.iter();
        let mut draw = Draw {
            site: terms::Site {
                model: &plan.model,
                joint: j,
                source: self.source,
                link: self.link,
            },
            motor_nm: plan.motor_nm[j],
            largest_nm: plan.largest_nm[j],
            fastest_rad_s: plan.fastest[j],
            largest_acceleration_rad_s2: plan.largest_acceleration[j],
            middle_rad: plan.joints[j].middle(),
            half_range_rad: plan.joints[j].half(),
            shortest_s: plan.shortest_s(),
            start_session_s: plan.starts_s[self.recording],
            path: instants
                .map(|instant| (instant.recording_s, &instant.target.position[..n]))
                .collect(),
            share: fixed.share,
            direction: fixed.direction,
            sign: fixed.sign,
            chance: &mut Numbers(rng),
        };
        effect.concealed?(&mut draw)
    }
}
