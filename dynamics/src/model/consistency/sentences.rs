//! The sentences of the findings about bodies.

use std::fmt;

use super::bodies::NUMBERS;
use super::finding::{BodyFault, BodyFinding, BodySeverity, LinkPlace, Substitute};

/// Upper bound on the links that a sentence names.
/// Chosen: a line of text holds three names.
const NAMED: usize = 3;

impl fmt::Display for BodyFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, seen) = (self.line(), seen(self));
        write!(f, "line {line}: {seen}{}", on_the_substitute(self))
    }
}

/// The finding and the advice.
fn seen(finding: &BodyFinding) -> String {
    let names = names(&finding.links);
    let count = finding.links.len();
    match &finding.fault {
        BodyFault::NotPositiveDefinite {
            moments_kgm2: [least, ..],
            rows,
        } => not_positive_definite(&names, *least, *rows),
        BodyFault::TriangleBroken { moments_kgm2, slip } => {
            let verdict = match finding.severity {
                BodySeverity::Impossible => "is impossible",
                BodySeverity::Odd => "is that of no real body",
            };
            let its = if count > 1 {
                "In the worst case, the"
            } else {
                "Its"
            };
            let inertia = format!("The inertia of {names} {verdict}. {its}");
            triangle(&inertia, moments_kgm2, *slip)
        }
        BodyFault::TooLarge {
            mass_kg,
            gyration_m,
            length_m,
        } => too_large(&names, [*mass_kg, *gyration_m, *length_m]),
        BodyFault::PointMass { gyration_m } => format!(
            "The mass of {names} is at one point or nearly so: the radius of gyration is at most {} m. Fast motions need \
             the inertia: add it to the <inertial> if you know it.",
            figure(*gyration_m)
        ),
        BodyFault::NoMass { moment_kgm2 } => format!(
            "{} has no mass, but an inertia of up to {} kg m². Correct the <mass> or remove the <inertial>.",
            capital(&names),
            figure(*moment_kgm2)
        ),
        BodyFault::CentreFar {
            distance_m,
            length_m,
            is_in_mm,
        } => {
            let up_to = if count > 1 { "up to " } else { "" };
            centre_far(
                &format!("{names} is {up_to}"),
                [*distance_m, *length_m],
                *is_in_mm,
            )
        }
        BodyFault::InertiaUnit {
            unit, masses_in_g, ..
        } => inertia_unit(count, unit, *masses_in_g),
        BodyFault::MassUnit { total } => format!(
            "The masses of all {count} moving links, {} kg in total, are too large for their inertias and lengths. They \
             are probably in g: convert them to kg.",
            figure(*total)
        ),
        BodyFault::LengthUnit { reach_m } => format!(
            "The arm of {} m is too long for the inertias of its links. The lengths are probably in mm: convert the <origin> \
             of each joint to m.",
            figure(*reach_m)
        ),
        BodyFault::SameInertia {
            moments_kgm2,
            of_links,
        } => format!(
            "{count} of {of_links} moving links have the same inertia ({} kg m²): {names}. It is probably a placeholder: \
             replace it by the inertias of the links.",
            figures(moments_kgm2)
        ),
        BodyFault::SameMass { mass_kg, of_links } => format!(
            "{count} of {of_links} moving links have the same mass, {} kg: {names}. It is probably a placeholder: replace \
             it by the masses of the links.",
            figure(*mass_kg)
        ),
    }
}

fn not_positive_definite(names: &str, least: f64, rows: Option<[f64; 6]>) -> String {
    let rows = rows.map_or_else(String::new, |numbers| {
        let pairs = NUMBERS.iter().zip(numbers);
        let pairs: Vec<String> = pairs
            .map(|(name, value)| format!("{name}=\"{value}\""))
            .collect();
        format!(
            " Its attributes {} look like the first two rows of a 3x3 matrix (xx xy xz yx yy yz). \
             Then the values of iyy and iyz are one place too far, and that of izz is missing: take it from the data sheet.",
            pairs.join(" ")
        )
    });
    format!(
        "The inertia of {names} is impossible, because it is not positive definite: its smallest principal moment is {} kg m².\
         {rows}",
        figure(least)
    )
}

/// `inertia`: the verdict and the beginning of the next sentence.
fn triangle(inertia: &str, [a, b, c]: &[f64; 3], slip: Option<(&'static str, f64, f64)>) -> String {
    let advice = slip.map_or_else(
        || "Correct its <inertia>.".to_owned(),
        |(name, value, better)| {
            format!(
                "{name}=\"{value}\" may be a decimal slip: {name}=\"{better}\" would be possible. Check the data sheet."
            )
        },
    );
    format!(
        "{inertia} largest principal moment is {} kg m². It cannot exceed the sum of the other two ({} + {} = {} kg m²). {advice}",
        figure(*c),
        figure(*b),
        figure(*a),
        figure(a + b)
    )
}

fn too_large(names: &str, [mass_kg, gyration_m, length_m]: [f64; 3]) -> String {
    format!(
        "The inertia of {names} is too large. Its radius of gyration is {} m for a mass of {} kg, but the link and its \
         neighbours are at most {} m long. Check the <inertia> for a decimal slip or another unit.",
        figure(gyration_m),
        figure(mass_kg),
        figure(length_m)
    )
}

/// `links`: their names and the verb.
fn centre_far(links: &str, [distance_m, length_m]: [f64; 2], is_in_mm: bool) -> String {
    let unit = if is_in_mm {
        ", probably from mm to m"
    } else {
        ""
    };
    format!(
        "The centre of mass of {links}{} m from the link's frame. The link and its neighbours are at most {} m long. \
         Correct the <origin> of its <inertial>{unit}.",
        figure(distance_m),
        figure(length_m)
    )
}

fn inertia_unit(count: usize, unit: &str, masses_in_g: bool) -> String {
    let (what, unit, si) = if masses_in_g {
        (
            "masses and inertias",
            format!("g and {unit}"),
            "kg and kg m²",
        )
    } else {
        ("inertias", unit.to_owned(), "kg m²")
    };
    format!(
        "The {what} of all {count} moving links are too large for their lengths. They are probably in {unit}: convert \
         them to {si}."
    )
}

/// The sentence on the numbers that the twin uses.
fn on_the_substitute(finding: &BodyFinding) -> String {
    let again =
        "Until the file is correct, results are provisional: correct it and run the command again.";
    if let BodyFault::CentreFar { is_in_mm: true, .. } = finding.fault {
        return " The twin reads it as mm.".to_owned();
    }
    match finding.substitutes.as_slice() {
        [] => match finding.fault {
            BodyFault::TriangleBroken { .. }
            | BodyFault::TooLarge { .. }
            | BodyFault::CentreFar { .. } => " The twin uses the numbers as they are.".to_owned(),
            _ => String::new(),
        },
        [
            Substitute {
                cylinder_kgm2: Some(moments),
                ..
            },
        ] => format!(
            " The twin uses the inertia of a uniform cylinder of the same mass instead (principal moments {} kg m²). \
             {again}",
            figures(moments)
        ),
        [first, ..] if first.cylinder_kgm2.is_some() => {
            format!(
                " The twin uses the inertias of uniform cylinders of the same masses instead. {again}"
            )
        }
        _ => " The twin converts them.".to_owned(),
    }
}

/// `link a`, `links a and b`, `links a, b, c and 3 more`, quoted.
fn names(links: &[LinkPlace]) -> String {
    let quoted: Vec<String> = (links.iter().take(NAMED))
        .map(|place| format!("`{}`", place.link))
        .collect();
    match (quoted.as_slice(), links.len().saturating_sub(NAMED)) {
        ([one], _) => format!("link {one}"),
        ([before @ .., last], 0) => format!("links {} and {last}", before.join(", ")),
        (all, more) => format!("links {} and {more} more", all.join(", ")),
    }
}

/// A number with three significant digits, without zeros at its end.
fn figure(x: f64) -> String {
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    let size = rounded.abs();
    if size != 0.0 && !(1e-5..1e7).contains(&size) {
        format!("{rounded:e}")
    } else {
        format!("{rounded}")
    }
}

fn figures(numbers: &[f64; 3]) -> String {
    numbers.map(figure).join(", ")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_to_three_links_are_named() {
        let place = |link: &str| LinkPlace {
            link: link.to_owned(),
            line: 1,
            inertia_line: 1,
        };
        let all = ["a", "b", "c", "d", "e"].map(place);
        assert_eq!(names(&all[..1]), "link `a`");
        assert_eq!(names(&all[..2]), "links `a` and `b`");
        assert_eq!(names(&all[..3]), "links `a`, `b` and `c`");
        assert_eq!(names(&all), "links `a`, `b`, `c` and 2 more");
    }

    #[test]
    fn numbers_have_three_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (7.1, "7.1"),
            (-0.139_01, "-0.139"),
            (12345.0, "12300"),
            (1.2345e-7, "1.23e-7"),
            (4.2e9, "4.2e9"),
        ] {
            assert_eq!(figure(x), expected);
        }
    }
}
