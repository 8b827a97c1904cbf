//! Wording of an effect and of its findings in reports.

/// Wording of an effect. Sentences are templates. A placeholder in `{}` is `place`, `source` (the joint that drives
/// it), `recording` (the one that it fills), or the name of a parameter, which is replaced by its value with unit and
/// interval. `{name:ratio}` omits the unit, and `{name:number}` also the interval.
#[derive(Debug, Clone, Copy)]
pub struct Words {
    /// Heading: `Coulomb friction`.
    pub title: &'static str,
    /// Noun phrase within a sentence: `a payload`.
    pub noun: &'static str,
    /// Physical meaning.
    pub meaning: &'static str,
    /// Parts to inspect; `{place}` and `{source}` are replaced. Empty if there is nothing to repair.
    pub look_at: &'static str,
    /// Sentence of a finding.
    pub finding: &'static str,
    /// Sentence of a finding that a corrected twin contains `{less}` too much of it.
    pub less: Option<&'static str>,
    /// Sentence of a finding whose first parameter may be zero, which then removes the whole effort.
    pub nothing: Option<&'static str>,
    /// Sentence of a finding whose parameters the recordings do not determine, if a list of them would not help.
    pub without_numbers: Option<&'static str>,
}

impl Words {
    /// Heading, noun, meaning, parts to inspect, and finding.
    pub const fn new(
        title: &'static str,
        noun: &'static str,
        meaning: &'static str,
        look_at: &'static str,
        finding: &'static str,
    ) -> Self {
        Self {
            title,
            noun,
            meaning,
            look_at,
            finding,
            less: None,
            nothing: None,
            without_numbers: None,
        }
    }
}

/// The quantity of a parameter, e.g. `mass` of `delta_mass_kg`, `centre of mass x` of `com_x_m`.
pub fn quantity(name: &str) -> String {
    let stem = unit(name).map_or(name, |(stem, _)| stem);
    let stem = stem.trim_start_matches("delta_").trim_start_matches("t_");
    stem.replace("com_", "centre_of_mass_").replace('_', " ")
}

/// Format of a value in a template.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// Value with unit and interval.
    Whole,
    /// Value with its interval.
    Ratio,
    /// Value alone.
    Number,
}

/// Placeholders of a template, in order: name and format of the value.
pub fn places(template: &str) -> impl Iterator<Item = (&str, Told)> {
    let after_brace = template.split('{').skip(1);
    after_brace.filter_map(|rest| Some(place(rest.split_once('}')?.0)))
}

/// Replaces the placeholders of a template.
pub fn fill(template: &str, value: impl Fn(&str, Told) -> String) -> String {
    let mut text = String::with_capacity(2 * template.len());
    let mut rest = template;
    while let Some((before, from)) = rest.split_once('{') {
        let (inner, after) = from.split_once('}').unwrap_or((from, ""));
        let (name, told) = place(inner);
        text.push_str(before);
        text.push_str(&value(name, told));
        rest = after;
    }
    text.push_str(rest);
    text
}

fn place(inner: &str) -> (&str, Told) {
    match inner.split_once(':') {
        Some((name, "ratio")) => (name, Told::Ratio),
        Some((name, _)) => (name, Told::Number),
        None => (inner, Told::Whole),
    }
}

/// Suffixes of canonical names with their units; longer suffixes come before the shorter ones that they contain.
const UNITS: [(&str, &str); 24] = [
    ("_nms2_per_rad2", "N m s²/rad²"),
    ("_nms_per_rad", "N m s/rad"),
    ("_nm_per_rad", "N m/rad"),
    ("_as2_per_rad2", "A s²/rad²"),
    ("_as_per_rad", "A s/rad"),
    ("_a_per_rad", "A/rad"),
    ("_n_per_m", "N/m"),
    ("_per_rad", "1/rad"),
    ("_per_nm", "1/(N m)"),
    ("_nm_per_s", "N m/s"),
    ("_per_s", "1/s"),
    ("_per_rev", "per turn"),
    ("_rad_s2", "rad/s²"),
    ("_rad_s", "rad/s"),
    ("_kgm2", "kg m²"),
    ("_kgm", "kg m"),
    ("_nm", "N m"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_rad", "rad"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
    ("_a", "A"),
];

/// Unit of a parameter and the rest of its canonical name; `None` for a pure number.
pub const fn unit(name: &str) -> Option<(&str, &'static str)> {
    let mut i = 0;
    while i < UNITS.len() {
        let (ending, unit) = UNITS[i];
        if let Some((stem, end)) = name
            .as_bytes()
            .split_at_checked(name.len().saturating_sub(ending.len()))
            && is_same(end, ending.as_bytes())
            && let Ok(stem) = std::str::from_utf8(stem)
        {
            return Some((stem, unit));
        }
        i += 1;
    }
    None
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// `value` with three significant digits and no trailing zeros, e.g. `4.1`, `0.0235`, `21`.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = usize::try_from(2 - magnitude).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A count with its noun, e.g. `1 event`, `3 events`. `noun` is a singular whose plural ends in s.
pub fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_is_filled_in_order() {
        let template = "Joint {place} has {coulomb_nm} and {gain:ratio} of {mass_kg:number}.";
        let named: Vec<_> = places(template).collect();
        let expected = [
            ("place", Told::Whole),
            ("coulomb_nm", Told::Whole),
            ("gain", Told::Ratio),
            ("mass_kg", Told::Number),
        ];
        assert_eq!(named, expected);
        let text = fill(template, |name, _| name.to_uppercase());
        assert_eq!(text, "Joint PLACE has COULOMB_NM and GAIN of MASS_KG.");
    }

    #[test]
    fn units_come_from_names() {
        for (name, expected) in [
            ("coulomb_nm", Some(("coulomb", "N m"))),
            ("growth_nm_per_s", Some(("growth", "N m/s"))),
            ("viscous_nms_per_rad", Some(("viscous", "N m s/rad"))),
            ("delta_com_x_m", Some(("delta_com_x", "m"))),
            (
                "stribeck_velocity_rad_s",
                Some(("stribeck_velocity", "rad/s")),
            ),
            ("force_x_n", Some(("force_x", "N"))),
            ("cycles_per_rev", Some(("cycles", "per turn"))),
            ("gain", None),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }

    #[test]
    fn a_parameter_is_named_by_its_quantity() {
        for (name, expected) in [
            ("mass_kg", "mass"),
            ("delta_com_z_m", "centre of mass z"),
            ("t_start_s", "start"),
            ("gain", "gain"),
        ] {
            assert_eq!(quantity(name), expected);
        }
    }

    #[test]
    fn one_thing_is_singular() {
        let told = [0, 1, 2].map(|count| counted(count, "more motion"));
        assert_eq!(told, ["0 more motions", "1 more motion", "2 more motions"]);
    }

    #[test]
    fn three_digits_are_enough() {
        for (value, text) in [
            (4.1, "4.1"),
            (0.023_46, "0.0235"),
            (21.0, "21"),
            (1234.5, "1234"),
            (-0.5, "-0.5"),
            (0.0, "0"),
            (100.0, "100"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
