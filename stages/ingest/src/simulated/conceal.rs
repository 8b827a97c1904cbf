//! Effects drawn at random: what a simulated cell conceals for somebody to find.

mod draw;
mod plan;

use std::borrow::Cow;

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Effect, Family, Layer, TermSpec};

use super::error::ScenarioError;
use super::scenario::Scenario;
use draw::{Candidate, candidate, drawn};
use plan::Plan;

/// What is drawn changes the effort of some joint by so many times its noise, root mean square over the
/// instants that it changes: it can be seen, and does not cry out.
/// Tuned: by hand, on no recorded seeds; not swept.
const VISIBLE: [f64; 2] = [5.0, 30.0];
/// Places that are tried for an effect.
/// Resolution: bounds the computing time; an effect without a place is an error.
const PLACES: usize = 30;
/// Halvings of the range of sizes.
/// Resolution: 2⁻²⁰ of the range.
const HALVINGS: usize = 20;

/// Effects that are drawn at random and added to the physics. Which, is written to `concealed.json`
/// alone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConcealSpec {
    /// What is drawn follows from this number, and from the robot and the motions.
    pub seed: u64,
    /// Effects to draw from; by default every known one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<String>,
    /// How many are drawn, each a different one; 0 for none.
    #[serde(default = "default_count")]
    #[schemars(range(max = 8))]
    pub count: u32,
}

fn default_count() -> u32 {
    1
}

/// What was concealed, as `concealed.json` holds it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Concealed {
    /// The effects.
    pub effects: Vec<ConcealedEffect>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConcealedEffect {
    /// The term.
    #[serde(flatten)]
    pub term: TermSpec,
    /// By how many times its noise it changes the effort of the joint that it changes most: root mean
    /// square over the instants of the planned motion that it changes.
    pub times_noise: f64,
}

/// How many of so many recordings may be fitted; the others are held out.
pub fn fit_count(recordings: usize) -> usize {
    match recordings {
        0..=2 => 1,
        n => n - 2,
    }
}

/// The scenario with what it conceals among its physics; as it is if it conceals nothing.
pub(super) fn add<'a>(
    scenario: &'a Scenario,
    model: &Model,
) -> Result<(Cow<'a, Scenario>, Option<Concealed>), ScenarioError> {
    let Some(spec) = &scenario.conceal else {
        return Ok((Cow::Borrowed(scenario), None));
    };
    let concealed = draw(spec, scenario, model)?;
    let mut open = scenario.clone();
    open.conceal = None;
    let terms = concealed.effects.iter().map(|effect| effect.term.clone());
    open.physics.extend(terms);
    Ok((Cow::Owned(open), Some(concealed)))
}

/// Whether it is what bodies weigh, for good: one of these at most.
fn is_mass(effect: &Effect) -> bool {
    effect.family == Family::Body && effect.lasts()
}

fn draw(
    spec: &ConcealSpec,
    scenario: &Scenario,
    model: &Model,
) -> Result<Concealed, ScenarioError> {
    let mut from = to_draw_from(spec)?;
    let mut effects: Vec<ConcealedEffect> = Vec::new();
    if spec.count == 0 {
        return Ok(Concealed { effects });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    from.shuffle(&mut rng);
    let mut plan = Plan::new(scenario, model)?;
    let mut has_mass = false;
    for effect in from {
        if effects.len() == spec.count as usize {
            break;
        }
        // What a link weighs more and what the tool carries may be one body.
        if is_mass(effect) && has_mass {
            continue;
        }
        for _ in 0..PLACES {
            let candidate = candidate(effect, &plan, &mut rng);
            let target = log_between(VISIBLE, &mut rng);
            let Some(candidate) = candidate else {
                continue;
            };
            // Two effects in a joint are another riddle, and two transmissions are none.
            let joint = candidate.term(candidate.sizes()[0]).joint;
            let taken = |term: &TermSpec| term.joint.is_some() && term.joint == joint;
            if effects.iter().any(|other| taken(&other.term)) {
                continue;
            }
            let Some(concealed) = sized(&candidate, target, &plan)? else {
                continue;
            };
            plan.add(concealed.term.clone())?;
            effects.push(concealed);
            has_mass |= is_mass(effect);
            break;
        }
    }
    if effects.len() < spec.count as usize {
        return Err(ScenarioError::Conceal {
            reason: format!(
                "only {} of {} effects can be seen in these motions without more than the motors have",
                effects.len(),
                spec.count
            ),
        });
    }
    Ok(Concealed { effects })
}

/// The effects to draw from.
fn to_draw_from(spec: &ConcealSpec) -> Result<Vec<&'static Effect>, ScenarioError> {
    let refuse = |reason| Err(ScenarioError::Conceal { reason });
    let mut effects: Vec<&'static Effect> = Vec::new();
    for name in &spec.effects {
        let Some(known) = drawn().find(|known| known.name == name) else {
            let known: Vec<&str> = drawn().map(|effect| effect.name).collect();
            let known = known.join(", ");
            return refuse(format!(
                "there is no effect `{name}` to be drawn; there are: {known}"
            ));
        };
        if effects.contains(&known) {
            return refuse(format!("`{name}` is there twice"));
        }
        effects.push(known);
    }
    if effects.is_empty() {
        effects = drawn().collect();
    }
    if spec.count as usize > effects.len() {
        return refuse(format!(
            "`count` is {}, but there are only {} effects to draw from",
            spec.count,
            effects.len()
        ));
    }
    Ok(effects)
}

/// The candidate at the size that is seen as well as `target` asks, if there is one.
fn sized(
    candidate: &Candidate,
    target: f64,
    plan: &Plan,
) -> Result<Option<ConcealedEffect>, ScenarioError> {
    let [mut least, mut most] = candidate.sizes();
    for _ in 0..HALVINGS {
        let middle = (least * most).sqrt();
        if plan.times_noise(&candidate.term(middle))? < target {
            least = middle;
        } else {
            most = middle;
        }
    }
    let term = candidate.term(most);
    let times_noise = plan.times_noise(&term)?;
    if !(VISIBLE[0]..=1.1 * VISIBLE[1]).contains(&times_noise) {
        return Ok(None);
    }
    if term.effect()?.layer != Layer::Record && !plan.motors_can(&term)? {
        return Ok(None);
    }
    Ok(Some(ConcealedEffect {
        term,
        times_noise: draw::rounded(times_noise),
    }))
}

/// A random number, any ratio as likely as any other.
fn log_between([least, most]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    least * (most / least).powf(rng.random::<f64>())
}
