//! Persistence of findings: they are computed anew each night, and a reported change is reported until it is
//! reversed, whatever other changes follow.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StudentT};
use tauscope_condition::{Estimate, Finding, Quantity, Series, assess};

const JOINTS: usize = 6;
const NIGHTS: usize = 240;
/// 2026-01-01.
const FIRST_DAY: f64 = 20_454.0;
/// The joint that changes first.
const WORN: usize = 2;
/// Night of the second change.
const LATER: usize = 150;

/// Relative increase of the worn joint's Coulomb friction, by night.
type More = fn(usize) -> f64;

/// Growth to 47 % in 70 nights.
fn wear(night: usize) -> f64 {
    0.47 * (night.saturating_sub(60) as f64 / 70.0).min(1.0)
}

/// Growth to 47 % in the fortnight before the second change.
fn fast_wear(night: usize) -> f64 {
    0.47 * (night.saturating_sub(LATER - 16) as f64 / 14.0).min(1.0)
}

/// Step to 47 %.
fn crash(night: usize) -> f64 {
    if night >= 120 { 0.47 } else { 0.0 }
}

/// Step to 47 % a week before the second change.
fn late_crash(night: usize) -> f64 {
    if night >= LATER - 7 { 0.47 } else { 0.0 }
}

/// The second change of the arm, in the night [`LATER`].
#[derive(Debug, Clone, Copy, PartialEq)]
enum Then {
    /// Lasting payload. It loads the gears, so that the friction of the joints that carry it is higher by this share.
    Payload { kg: f64, share: f64 },
    /// Payload for a week.
    Week { kg: f64, share: f64 },
    /// Sudden rise of the friction of one joint.
    Step { joint: usize, by: f64 },
    /// Higher friction of all joints.
    All { by: f64 },
}

impl Then {
    fn kg(self, night: usize) -> f64 {
        match self {
            Self::Payload { kg, .. } if night >= LATER => kg,
            Self::Week { kg, .. } if (LATER..LATER + 7).contains(&night) => kg,
            _ => 0.0,
        }
    }

    fn more(self, joint: usize, night: usize) -> f64 {
        match self {
            Self::Payload { share, .. } if night >= LATER && (1..4).contains(&joint) => share,
            Self::Week { share, .. }
                if (LATER..LATER + 7).contains(&night) && (1..4).contains(&joint) =>
            {
                share
            }
            Self::Step { joint: own, by } if own == joint && night >= LATER => by,
            Self::All { by } if night >= LATER => by,
            _ => 0.0,
        }
    }
}

fn arm(seed: u64, more: More, then: Then, has_sensor: bool) -> Vec<Series> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut weather = 0.0;
    let temperatures: Vec<f64> = (0..NIGHTS)
        .map(|_| {
            weather = 0.8 * weather + random.random_range(-1.2..1.2);
            34.0 + weather
        })
        .collect();
    let mut series =
        |joint: Option<usize>, quantity, deviation: f64, value: &dyn Fn(usize) -> f64| {
            let estimates = (0..NIGHTS).map(|night| {
                let own = deviation * random.random_range(0.7..1.4);
                let found = value(night) + own * StudentT::new(12.0).unwrap().sample(&mut random);
                Estimate {
                    day: FIRST_DAY + night as f64,
                    value: found,
                    low: found - 1.96 * own,
                    high: found + 1.96 * own,
                    temperature_c: has_sensor.then(|| temperatures[night].round()),
                    hours_since_start: None,
                }
            });
            Series {
                joint: joint.map(|joint| format!("joint{}", joint + 1)),
                quantity,
                estimates: estimates.collect(),
            }
        };
    let mut all = Vec::new();
    for joint in 0..JOINTS {
        let level = 8.0 / (1.0 + joint as f64);
        let coulomb = |night: usize| {
            let own = if joint == WORN { more(night) } else { 0.0 };
            let warm = (-0.002 * (temperatures[night] - 34.0)).exp();
            level * warm * (1.0 + own + then.more(joint, night))
        };
        let viscous = |night: usize| level * (-0.008 * (temperatures[night] - 34.0)).exp();
        all.push(series(
            Some(joint),
            Quantity::Coulomb,
            0.015 * level,
            &coulomb,
        ));
        all.push(series(
            Some(joint),
            Quantity::Viscous,
            0.02 * level,
            &viscous,
        ));
    }
    all.push(series(None, Quantity::Payload, 0.08, &|night| {
        then.kg(night)
    }));
    all
}

/// Findings when the newest night is `night`.
fn told_in(all: &[Series], night: usize) -> Vec<Finding> {
    let known = all.iter().map(|one| Series {
        estimates: one.estimates[..=night].to_vec(),
        ..one.clone()
    });
    assess(&known.collect::<Vec<_>>(), &[])
}

/// Whether the findings have a lasting change of the worn joint's friction.
fn names(findings: &[Finding]) -> bool {
    findings.iter().any(|one| {
        let own = one.joint.as_deref() == Some("joint3") && one.quantity.is_friction();
        own && one.is_alarm() && one.until.is_none() && one.size > 0.0
    })
}

#[test]
fn a_change_that_was_told_is_told_until_it_is_reversed_whatever_comes_later() {
    let later = [
        Then::Payload {
            kg: 2.0,
            share: 0.0,
        },
        Then::Payload {
            kg: 2.0,
            share: 0.1,
        },
        Then::Payload {
            kg: 2.0,
            share: 0.4,
        },
        Then::Payload {
            kg: 0.3,
            share: 0.1,
        },
        Then::Week {
            kg: 2.0,
            share: 0.2,
        },
        Then::Step {
            joint: WORN,
            by: 0.3,
        },
        Then::Step {
            joint: WORN,
            by: -0.3,
        },
        Then::Step { joint: 4, by: 0.3 },
        Then::All { by: 0.3 },
    ];
    let mut missing = Vec::new();
    for (name, more) in [
        ("wear", wear as More),
        ("fast wear", fast_wear),
        ("crash", crash),
        ("late crash", late_crash),
    ] {
        for then in later {
            for (seed, has_sensor) in [(1, true), (2, false)] {
                let all = arm(seed, more, then, has_sensor);
                let first = (80..LATER)
                    .step_by(2)
                    .find(|night| names(&told_in(&all, *night)));
                let Some(first) = first else {
                    missing.push(format!(
                        "{name}, {then:?}, sensor {has_sensor}: never reported"
                    ));
                    continue;
                };
                let is_named = |night: &usize| !names(&told_in(&all, *night));
                let gone: Vec<usize> = (first..NIGHTS).step_by(7).filter(is_named).collect();
                if let (Some(from), Some(to)) = (gone.first(), gone.last()) {
                    let said = told_in(&all, *to);
                    let said: Vec<&str> = said.iter().map(|one| one.sentence.as_str()).collect();
                    missing.push(format!(
                        "{name}, {then:?}, sensor {has_sensor}: reported in night {first}, not in {} from {from} to {to}: {said:?}",
                        gone.len()
                    ));
                }
            }
        }
    }
    assert!(
        missing.is_empty(),
        "{} cases:\n{}",
        missing.len(),
        missing.join("\n")
    );
}
