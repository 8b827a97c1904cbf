//! Physical consistency of the bodies of a URDF: which inertias, masses and centres of mass no real link has.
//!
//! Links that stand still are not checked, because their inertia has no effect. Neither are dummy links, whose mass and
//! inertia are less than a hundredth of those of the rigid body that they belong to.

use std::cmp::{Ordering, Reverse};
use std::collections::BTreeMap;

use self::bodies::{Bodies, Body, NUMBERS, bodies};
use self::finding::LinkPlace;
use self::moments::Principal;
use self::substitute::{centre_in_m, converted, cylinder, significant};
use self::units::{Units, are_lengths_in_mm, units};
use super::ModelError;

mod bodies;
mod finding;
mod moments;
mod sentences;
mod substitute;
mod units;

pub use finding::{BodyFault, BodyFinding, BodySeverity, LinkPlace as BodyPlace, Substitute};
pub use substitute::with_plausible_bodies;

/// Absolute value of a negative principal moment from which an inertia is impossible, relative to the largest moment.
/// Derived: a URDF's inertia is accurate to a tenth, so that a negative moment of less than a hundredth of the largest has
/// no effect that can be measured.
const NEGATIVE: f64 = 0.01;
/// Excess of the largest principal moment over the sum of the other two from which a finding begins, relative to the
/// largest.
/// Measured: without errors that are known, up to 0.05 in the URDFs of 81 robots (CAD exports, identified parameters).
const EXCESS: f64 = 0.06;
/// Excess of the largest principal moment, relative to it, from which the inertia is impossible.
/// Derived: a decimal slip by ten in the largest moment makes at least 0.8 of it, in the middle one at least 0.7. Published
/// URDFs whose inertias were computed by a wrong formula have up to 0.33.
const GROSS_EXCESS: f64 = 0.5;
/// Radius of gyration from which a finding begins, in lengths of the link and its neighbours.
/// Measured: at most 1.2 in the same URDFs, except for placeholders and a known error. Derived: mass within one length of
/// its centre has at most 1; a long tool without frames may have more.
const LARGE: f64 = 2.0;
/// Radius of gyration, in the same lengths, from which the inertia is impossible.
/// Measured: placeholders and inertias in another unit have 14 and more; the known error has 4.
const ABSURD: f64 = 5.0;
/// Radius of gyration below which a body is a point mass, in lengths of the link and its neighbours.
/// Measured: at least 0.02 for links whose inertia is not a placeholder. Derived: a uniform rod has 0.29.
const POINT: f64 = 0.01;
/// Distance of a centre of mass from its link's frame above which it is in mm, in lengths of the link and its neighbours.
/// Derived: 0.05 lengths in mm are 50.
const IN_MM: f64 = 50.0;
/// Least number of links with equal numbers that are placeholders.
/// Chosen: pairs of equal links are common.
const LEAST_EQUAL: usize = 3;
/// Largest power of ten of a decimal slip.
/// Chosen: kg mm² instead of kg m².
const LARGEST_SLIP: i32 = 6;

/// Checks masses, centres of mass and inertias of the moving links of a URDF.
///
/// Impossible bodies come before odd ones, each in the order of the document. A sound robot has no finding.
///
/// # Errors
/// If the text is no URDF, or its links and joints are no tree.
pub fn check_bodies(xml: &str) -> Result<Vec<BodyFinding>, ModelError> {
    let as_written = bodies(xml)?;
    let units = units(&as_written);
    let scaled = units.map_or_else(
        || as_written.links.clone(),
        |units| {
            let links = as_written.links.iter();
            links
                .map(|body| body.scaled(units.mass, units.inertia))
                .collect()
        },
    );
    let mut findings: Vec<BodyFinding> = scaled.iter().filter_map(inertia).collect();
    if let Some(units) = units {
        findings.insert(0, of_units(units, &as_written, &scaled, &findings));
    }
    findings.extend(centres(&scaled));
    if units.is_none() && are_lengths_in_mm(&as_written) {
        findings.retain(|finding| !matches!(finding.fault, BodyFault::PointMass { .. }));
        findings.push(BodyFinding {
            severity: BodySeverity::Impossible,
            links: places(scaled.iter()),
            fault: BodyFault::LengthUnit {
                reach_m: as_written.reach_m,
            },
            substitutes: Vec::new(),
        });
    }
    merge_points(&mut findings);
    merge_odd_triangles(&mut findings);
    merge_same_inertia(&mut findings, &scaled);
    findings.extend(same_mass(&scaled));
    findings.sort_by_key(|finding| (Reverse(finding.severity), finding.line()));
    Ok(findings)
}

fn finding(severity: BodySeverity, body: &Body, fault: BodyFault) -> BodyFinding {
    let substitutes = match severity {
        BodySeverity::Impossible => vec![cylinder(body)],
        BodySeverity::Odd => Vec::new(),
    };
    BodyFinding {
        severity,
        links: vec![body.place.clone()],
        fault,
        substitutes,
    }
}

/// The finding about a body's inertia.
fn inertia(body: &Body) -> Option<BodyFinding> {
    use BodySeverity::{Impossible, Odd};
    let principal = &body.principal;
    let (scale, moments_kgm2) = (principal.scale(), principal.moments);
    if body.mass_kg == 0.0 {
        let moment_kgm2 = scale;
        return Some(finding(Odd, body, BodyFault::NoMass { moment_kgm2 }));
    }
    let length_m = body.size_m();
    if (scale / body.mass_kg).sqrt() < POINT * length_m {
        let gyration_m = body.gyration_m();
        return Some(finding(Odd, body, BodyFault::PointMass { gyration_m }));
    }
    let least = (NEGATIVE * scale).max(principal.smallest_by_rounding(body.half_unit));
    if principal.smallest() < -least {
        let fault = BodyFault::NotPositiveDefinite {
            moments_kgm2,
            rows: Some(body.numbers).filter(is_in_rows),
        };
        return Some(finding(Impossible, body, fault));
    }
    let by_rounding = principal.excess_by_rounding(body.half_unit);
    if principal.excess() > by_rounding.max(EXCESS * scale) {
        let is_gross = principal.excess() > GROSS_EXCESS * scale;
        let severity = if is_gross { Impossible } else { Odd };
        let slip = slip(body);
        let fault = BodyFault::TriangleBroken { moments_kgm2, slip };
        return Some(finding(severity, body, fault));
    }
    let gyration_m = body.gyration_m();
    let severity = match gyration_m / length_m {
        ratio if ratio > ABSURD => Impossible,
        ratio if ratio > LARGE => Odd,
        _ => return None,
    };
    let fault = BodyFault::TooLarge {
        mass_kg: body.mass_kg,
        gyration_m,
        length_m,
    };
    Some(finding(severity, body, fault))
}

/// Whether the six numbers are probably xx, xy, xz, yx, yy, yz: the fourth repeats the second, and the fifth is a moment.
#[expect(clippy::float_cmp, reason = "a matrix repeats a number as it is")]
fn is_in_rows([xx, xy, _, yx, yy, _]: &[f64; 6]) -> bool {
    xy == yx && yy.abs() > xy.abs() && xx.abs() > xy.abs()
}

/// The largest diagonal number as a decimal slip: attribute, value, and the value with which the inertia is that of a real
/// body.
fn slip(body: &Body) -> Option<(&'static str, f64, f64)> {
    let largest = [0, 3, 5]
        .into_iter()
        .max_by(|&a, &b| body.numbers[a].total_cmp(&body.numbers[b]))?;
    let value = body.numbers[largest];
    let fits = |power: i32| {
        let mut numbers = body.numbers;
        numbers[largest] = significant(value / 10_f64.powi(power));
        let principal = Principal::of(numbers)?;
        let fits = principal.smallest() > 0.0 && principal.excess() <= 0.0;
        fits.then_some(numbers[largest])
    };
    let better = (1..=LARGEST_SLIP).find_map(fits)?;
    Some((NUMBERS[largest], value, better))
}

/// The finding that the file has other units. Links with an impossible inertia have a substitute of their own.
fn of_units(
    units: Units,
    as_written: &Bodies,
    scaled: &[Body],
    findings: &[BodyFinding],
) -> BodyFinding {
    let is_replaced = |body: &Body| {
        let mut replaced = findings.iter().flat_map(|finding| &finding.substitutes);
        replaced.any(|substitute| substitute.link == body.place.link)
    };
    let masses_in_g = units.mass < 1.0;
    let fault = if units.inertia < 1.0 {
        BodyFault::InertiaUnit {
            unit: units.name,
            factor: units.inertia,
            masses_in_g,
        }
    } else {
        let total = as_written.links.iter().map(|body| body.mass_kg).sum();
        BodyFault::MassUnit { total }
    };
    let convert =
        |body: &Body| converted(body, masses_in_g, units.inertia < 1.0 && !is_replaced(body));
    BodyFinding {
        severity: BodySeverity::Impossible,
        links: places(scaled.iter()),
        fault,
        substitutes: scaled.iter().map(convert).collect(),
    }
}

fn places<'a>(bodies: impl Iterator<Item = &'a Body>) -> Vec<LinkPlace> {
    bodies.map(|body| body.place.clone()).collect()
}

/// The findings about centres of mass far outside of their links: one for those in mm, one for each other.
fn centres(bodies: &[Body]) -> Vec<BodyFinding> {
    let far: Vec<&Body> = bodies.iter().filter(|body| body.is_centre_far()).collect();
    let is_in_mm = |body: &&Body| body.com_m.norm() > IN_MM * body.length_m();
    let (in_mm, others): (Vec<&Body>, Vec<&Body>) = far.into_iter().partition(is_in_mm);
    let fault = |body: &Body, is_in_mm: bool| BodyFault::CentreFar {
        distance_m: body.com_m.norm(),
        length_m: body.length_m(),
        is_in_mm,
    };
    let farthest = |a: &&&Body, b: &&&Body| a.com_m.norm().total_cmp(&b.com_m.norm());
    let first = in_mm.iter().max_by(farthest).map(|body| BodyFinding {
        severity: BodySeverity::Impossible,
        links: places(in_mm.iter().copied()),
        fault: fault(body, true),
        substitutes: in_mm.iter().map(|body| centre_in_m(body)).collect(),
    });
    let others = others
        .iter()
        .map(|body| finding(BodySeverity::Odd, body, fault(body, false)));
    first.into_iter().chain(others).collect()
}

/// Merges the findings about point masses into one.
fn merge_points(findings: &mut Vec<BodyFinding>) {
    let mut merged: Option<BodyFinding> = None;
    findings.retain(|finding| {
        let BodyFault::PointMass { gyration_m } = finding.fault else {
            return true;
        };
        match &mut merged {
            None => merged = Some(finding.clone()),
            Some(all) => {
                all.links.extend(finding.links.iter().cloned());
                if let BodyFault::PointMass { gyration_m: most } = &mut all.fault {
                    *most = most.max(gyration_m);
                }
            }
        }
        false
    });
    findings.extend(merged);
}

/// Merges the findings about inertias that are odd by the triangle inequality into one, with the moments of the worst.
fn merge_odd_triangles(findings: &mut Vec<BodyFinding>) {
    let excess = |finding: &BodyFinding| match finding.fault {
        BodyFault::TriangleBroken {
            moments_kgm2: [a, b, c],
            ..
        } if finding.severity == BodySeverity::Odd => Some((c - b - a) / c),
        _ => None,
    };
    let odd: Vec<BodyFinding> = findings.extract_if(.., |f| excess(f).is_some()).collect();
    let worst = |a: &&BodyFinding, b: &&BodyFinding| excess(a).partial_cmp(&excess(b));
    let worst = (odd.iter()).max_by(|a, b| worst(a, b).unwrap_or(Ordering::Equal));
    findings.extend(worst.map(|worst| BodyFinding {
        links: odd.iter().flat_map(|one| one.links.clone()).collect(),
        ..worst.clone()
    }));
}

/// Finds the numbers that most links share as their inertia, and merges the findings about too large inertias of equal
/// numbers.
fn merge_same_inertia(findings: &mut Vec<BodyFinding>, bodies: &[Body]) {
    let extended: Vec<&Body> = (bodies.iter())
        .filter(|body| body.mass_kg > 0.0 && body.gyration_m() >= POINT * body.size_m())
        .collect();
    let numbers: BTreeMap<&str, [f64; 6]> = (bodies.iter())
        .map(|body| (body.place.link.as_str(), body.numbers))
        .collect();
    let mut merged: Vec<BodyFinding> = Vec::new();
    for finding in findings.drain(..) {
        let is_large = |other: &&mut BodyFinding| {
            let both = matches!(
                (&finding.fault, &other.fault),
                (BodyFault::TooLarge { .. }, BodyFault::TooLarge { .. })
            );
            both && finding.severity == other.severity
                && numbers.get(finding.link()) == numbers.get(other.link())
        };
        match merged.iter_mut().find(is_large) {
            Some(other) => {
                other.links.extend(finding.links);
                other.substitutes.extend(finding.substitutes);
            }
            None => merged.push(finding),
        }
    }
    *findings = merged;
    let Some((first, equal)) = most_equal(&extended, |body| body.numbers) else {
        return;
    };
    let links = places(equal.iter().copied());
    let is_replaced = |finding: &BodyFinding| {
        matches!(finding.fault, BodyFault::TooLarge { .. }) && links.contains(&finding.links[0])
    };
    let replaced = findings.extract_if(.., |finding| is_replaced(finding));
    let severity = replaced.map(|finding| finding.severity).max();
    let substitutes = match severity {
        // A placeholder that is impossible for some links is wrong for all.
        Some(BodySeverity::Impossible) => equal.iter().map(|body| cylinder(body)).collect(),
        _ => Vec::new(),
    };
    findings.push(BodyFinding {
        severity: severity.unwrap_or(BodySeverity::Odd),
        fault: BodyFault::SameInertia {
            moments_kgm2: first.principal.moments,
            of_links: extended.len(),
        },
        substitutes,
        links,
    });
}

fn same_mass(bodies: &[Body]) -> Option<BodyFinding> {
    let heavy: Vec<&Body> = bodies.iter().filter(|body| body.mass_kg > 0.0).collect();
    let (first, equal) = most_equal(&heavy, |body| body.mass_kg)?;
    Some(BodyFinding {
        severity: BodySeverity::Odd,
        links: places(equal.iter().copied()),
        fault: BodyFault::SameMass {
            mass_kg: first.mass_kg,
            of_links: heavy.len(),
        },
        substitutes: Vec::new(),
    })
}

/// The bodies that agree in `key`, if they are most of all and more than a pair; with the first of them.
fn most_equal<'a, K: PartialEq>(
    bodies: &[&'a Body],
    key: impl Fn(&Body) -> K,
) -> Option<(&'a Body, Vec<&'a Body>)> {
    let equal = |first: &&'a Body| {
        let same = bodies.iter().filter(|body| key(body) == key(first));
        (*first, same.copied().collect::<Vec<_>>())
    };
    let sets = bodies.iter().map(equal);
    let (first, most) = sets.max_by_key(|(_, same)| same.len())?;
    (most.len() >= LEAST_EQUAL && 2 * most.len() > bodies.len()).then_some((first, most))
}
