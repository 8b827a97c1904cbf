//! Units of masses and inertias that differ from those of a URDF in the whole file.

use super::bodies::{Bodies, Body};

/// Range of the radius of gyration of a sound link, in lengths of the link and its neighbours.
/// Measured: 0.02 to 1.2 for the moving links of 81 URDFs with an inertia that is not a placeholder or an error.
const SOUND: [f64; 2] = [0.02, 2.0];
/// Median of the same ratio.
/// Measured: 0.24 and 0.25 in two sets of URDFs.
const TYPICAL: f64 = 0.25;
/// Share of the links that a unit must make sound.
/// Chosen: single links may have another fault in addition.
const MOST: f64 = 0.75;
/// Mass over the cube of the reach above which a robot's masses are in g \[kg/m³\].
/// Derived: an arm is at most as heavy as a cube of water whose edges are as long as the arm reaches. Arms have 5 to 30.
const HEAVIEST_KG_M3: f64 = 1000.0;
/// Units of inertia and their size in kg m².
/// Derived: g is 1e-3 kg, cm² is 1e-4 m², mm² is 1e-6 m².
const UNITS: [(&str, f64); 6] = [
    ("kg m²", 1.0),
    ("g m²", 1e-3),
    ("kg cm²", 1e-4),
    ("kg mm²", 1e-6),
    ("g cm²", 1e-7),
    ("g mm²", 1e-9),
];

/// The probable units of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Unit of the masses \[kg\].
    pub mass: f64,
    /// Unit of the inertias \[kg m²\].
    pub inertia: f64,
    /// Name of the unit of the inertias.
    pub name: &'static str,
}

/// The units of a file whose masses or inertias are not in kg and kg m²; `None` if they are, or if no unit explains them.
pub fn units(bodies: &Bodies) -> Option<Units> {
    let links: Vec<&Body> = (bodies.links.iter())
        .filter(|body| body.mass_kg > 0.0 && body.principal.largest() > 0.0)
        .collect();
    // Neither one link nor equal numbers distinguish another unit of the file from a slip or a placeholder.
    #[expect(
        clippy::float_cmp,
        reason = "a placeholder repeats numbers as they are"
    )]
    let are_equal = links.iter().all(|body| body.numbers == links[0].numbers);
    if links.len() < 2 || are_equal || is_sound(median(&ratios(&links, 1.0, 1.0))) {
        return None;
    }
    let total: f64 = links.iter().map(|body| body.mass_kg).sum();
    let in_g = bodies.reach_m > 0.0 && total > HEAVIEST_KG_M3 * bodies.reach_m.powi(3);
    let mass = if in_g { 1e-3 } else { 1.0 };
    let fits = UNITS.iter().filter_map(|(name, inertia)| {
        let ratios = ratios(&links, mass, *inertia);
        let sound = ratios.iter().filter(|ratio| is_sound(**ratio)).count();
        let off = (median(&ratios) / TYPICAL).log10().abs();
        let units = Units {
            mass,
            inertia: *inertia,
            name,
        };
        (sound as f64 >= MOST * links.len() as f64).then_some((off, units))
    });
    let (_, best) = fits.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
    Some(best)
}

/// Whether the distances between the joints are in mm: the links are too long for their inertias by about 1000.
pub fn are_lengths_in_mm(bodies: &Bodies) -> bool {
    let ratios: Vec<f64> = (bodies.links.iter())
        .filter(|body| body.mass_kg > 0.0 && body.extent_m > 0.0)
        .map(|body| body.gyration_m() / body.extent_m)
        .collect();
    // A single small inertia may be wrong itself.
    let median = median(&ratios);
    ratios.len() > 1 && median < SOUND[0] && is_sound(1e3 * median)
}

/// Radius of gyration over the length, by link.
fn ratios(links: &[&Body], mass: f64, inertia: f64) -> Vec<f64> {
    let scaled = links.iter().map(|body| body.scaled(mass, inertia));
    scaled
        .map(|body| body.gyration_m() / body.size_m())
        .collect()
}

fn is_sound(ratio: f64) -> bool {
    (SOUND[0]..=SOUND[1]).contains(&ratio)
}

fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
