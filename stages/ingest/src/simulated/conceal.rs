//! Effects drawn at random, which a simulated cell conceals as the task of an identification.

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

/// Range of the effort change by a drawn effect, in multiples of the joint's effort noise: root mean square over
/// the instants that it changes. Visible, but not obvious.
/// Chosen: for simulated cells only; an effect at 5 is just visible, one at 30 is far above the noise without being
/// obvious.
const VISIBLE: [f64; 2] = [5.0, 30.0];
/// Maximum number of places tried for an effect.
/// Resolution: bounds the computing time; an effect without a place is an error.
const PLACES: usize = 30;
/// Number of bisections of the range of sizes.
/// Resolution: 2⁻²⁰ of the range.
const HALVINGS: usize = 20;

/// Effects that are drawn at random and added to the physics. Only the file `concealed.json` names
/// them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConcealSpec {
    /// Seed of the draw, which also depends on the robot and the motions.
    pub seed: u64,
    /// Names of the effects to draw from; by default all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<String>,
    /// Number of effects to draw, all different; 0 for none.
    #[serde(default = "default_count")]
    #[schemars(range(max = 8))]
    pub count: u32,
}

fn default_count() -> u32 {
    1
}

/// Concealed effects, as written to `concealed.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Concealed {
    /// The effects.
    pub effects: Vec<ConcealedEffect>,
}

/// A concealed effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConcealedEffect {
    /// The term.
    #[serde(flatten)]
    pub term: TermSpec,
    /// Effort change in multiples of the noise, at the joint that it changes most: root mean square over
    /// the instants of the planned motion that it changes.
    pub times_noise: f64,
}

/// Returns the number of `recordings` that may be fitted; the others are held out.
pub fn fit_count(recordings: usize) -> usize {
    match recordings {
        0..=2 => 1,
        n => n - 2,
    }
}

/// Adds the effects that a scenario conceals to its physics; returns it unchanged if it conceals none.
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

/// Whether an effect is a permanent mass of a body, of which at most one is drawn.
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
        // A surplus mass of a link and an undeclared payload may be the same body.
        if is_mass(effect) && has_mass {
            continue;
        }
        for _ in 0..PLACES {
            let candidate = candidate(effect, &plan, &mut rng);
            let target = log_between(VISIBLE, &mut rng);
            let Some(candidate) = candidate else {
                continue;
            };
            // One effect per joint: two confound each other, and two transmissions cannot be simulated.
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
                "only {} of {} effects are visible in these motions within the motors' limits",
                effects.len(),
                spec.count
            ),
        });
    }
    Ok(Concealed { effects })
}

/// Returns the effects to draw from.
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

/// Returns the candidate at the size whose multiple of the noise is `target`, if there is one.
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

/// Returns a random number whose logarithm is uniformly distributed.
fn log_between([least, most]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    least * (most / least).powf(rng.random::<f64>())
}
