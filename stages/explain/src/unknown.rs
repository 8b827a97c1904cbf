//! What no name fits: how it depends on the motion or on time, as a curve, so that the fit improves all the same.

use tauscope_dynamics::terms::{Against, MotionSample, Table, effect};

use crate::active::{Active, Column, Hypothesis, Whereabouts};
use crate::problem::Problem;
use crate::propose::Base;

/// Knots of a curve.
const KNOTS: usize = 10;
/// A value of a curve below this share of its largest is taken for zero.
const EVIDENT: f64 = 0.2;

/// A curve in a joint, and what it gains.
#[derive(Debug, Clone)]
pub struct CurveProposal {
    /// The `unknown` effect.
    pub active: Active,
    /// Gain of log-likelihood.
    pub gain: f64,
    /// What so many numbers gain by chance.
    pub penalty: f64,
    /// Share of what was left at the joint, over what is then left.
    pub size: f64,
}

impl CurveProposal {
    /// Evidence for it \[nats\].
    pub fn evidence(&self) -> f64 {
        self.gain - self.penalty
    }
}

impl Base<'_> {
    /// The curve that explains most of what is left at a joint.
    pub fn propose_curve(&self, joint: usize) -> Option<CurveProposal> {
        let candidates = curves(self.problem, joint);
        let count = candidates.len() as f64;
        let mut best: Option<CurveProposal> = None;
        for curve in candidates {
            let Some(mut proposal) = self.try_curve(joint, &curve) else {
                continue;
            };
            proposal.penalty += count.ln();
            if best
                .as_ref()
                .is_none_or(|best| proposal.evidence() > best.evidence())
            {
                best = Some(proposal);
            }
        }
        best
    }

    fn try_curve(&self, joint: usize, curve: &Table) -> Option<CurveProposal> {
        let hypothesis = Hypothesis {
            effect: effect("unknown")?,
            place: Whereabouts {
                joint,
                ..Whereabouts::default()
            },
        };
        let knots = curve.knots.len();
        let at = |values: Vec<f64>| Active {
            hypothesis,
            coordinates: values,
            curve: Some(curve.clone()),
        };
        let columns: Vec<Column> = (0..knots)
            .map(|k| {
                let mut values = vec![0.0; knots];
                values[k] = 1.0;
                self.fit.added(self.problem, &at(values))
            })
            .collect();
        let minimum = vec![f64::NEG_INFINITY; knots];
        let (values, gain, size) = self.try_columns(None, &columns, &minimum)?;
        Some(CurveProposal {
            active: at(values),
            gain,
            penalty: self.penalty(knots, Some(joint)),
            size,
        })
    }
}

/// Sets the small values of a curve to zero: they are what is left of noise, and where the curve ends they would be held
/// for ever.
pub fn keep_what_is_evident(curve: &mut Active) {
    let largest = curve
        .coordinates
        .iter()
        .fold(0.0_f64, |most, x| most.max(x.abs()));
    for value in &mut curve.coordinates {
        if value.abs() < EVIDENT * largest {
            *value = 0.0;
        }
    }
}

/// Curves worth a try in a joint, their knots spread evenly over the samples.
fn curves(problem: &Problem, joint: usize) -> Vec<Table> {
    let mut all = Vec::new();
    let mut add = |against: Against, of_joint: usize| {
        let mut values = Vec::new();
        for track in &problem.tracks {
            track
                .track
                .each(|_, at: &MotionSample<'_>| values.push(against.value(at, of_joint)));
        }
        values.sort_by(f64::total_cmp);
        let last = values.len() - 1;
        let mut knots: Vec<f64> = (0..KNOTS).map(|k| values[last * k / (KNOTS - 1)]).collect();
        let least = 0.02 * (knots[KNOTS - 1] - knots[0]);
        knots.dedup_by(|later, earlier| *later - *earlier <= least);
        if knots.len() < 3 {
            return;
        }
        for by_direction in [false, true] {
            all.push(Table {
                against,
                of_joint,
                by_direction,
                values: vec![0.0; knots.len()],
                knots: knots.clone(),
            });
        }
    };
    for of_joint in 0..problem.joints {
        add(Against::Position, of_joint);
        add(Against::Velocity, of_joint);
    }
    add(Against::Acceleration, joint);
    add(Against::Load, joint);
    add(Against::RecordingTime, joint);
    add(Against::SessionTime, joint);
    all
}
