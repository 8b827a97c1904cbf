//! Names of parameters, units and numbers for the person who runs the cell.

use serde_json::Value;
use tauscope_dynamics::terms::words::unit;

use tauscope_explain::report::in_units;

/// `some_name` as `Some name`.
pub(super) fn sentence_case(name: &str) -> String {
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => words,
    }
}

/// Labels of parameters whose names are not clear by themselves.
const USUAL: [(&str, &str); 18] = [
    ("t_start", "Begins"),
    ("t_end", "Ends"),
    ("coulomb", "Coulomb friction"),
    ("coulomb_positive", "Friction forward"),
    ("coulomb_negative", "Friction backward"),
    ("coulomb_before", "Friction before"),
    ("coulomb_after", "Friction after"),
    ("coulomb_start", "Friction at the start"),
    ("growth", "Change"),
    ("gain_excess_start", "Gain excess at the start"),
    ("share_of_effort", "Share of the effort"),
    ("static", "Static friction"),
    ("viscous", "Viscous friction"),
    ("viscous_warm", "Viscous friction, warm"),
    ("viscous_extra_cold", "Additional viscous friction, cold"),
    ("change_time_session", "Changed at, in the session"),
    ("turning", "Turns over"),
    ("release", "Release time"),
];

/// A parameter's name in words and its unit (empty for a pure number), from its canonical name.
pub(super) fn parameter(name: &str) -> (String, &'static str) {
    let found = |name: &str| unit(name).map(|(stem, unit)| (stem.to_owned(), unit));
    let second = || {
        let (stem, unit) = found(name.strip_suffix('2')?)?;
        Some((stem + "2", unit))
    };
    let (stem, unit) = found(name)
        .or_else(second)
        .unwrap_or_else(|| (name.to_owned(), ""));
    (parameter_label(&stem), unit)
}

/// A parameter's name and unit at a joint: in A if `amperes`, for a prismatic joint if `slides`.
pub(super) fn parameter_in(name: &str, amperes: bool, slides: bool) -> (String, String) {
    let (label, unit) = parameter(name);
    (label, in_units(unit, amperes, slides))
}

fn parameter_label(stem: &str) -> String {
    let usual = USUAL.iter().find(|(name, _)| *name == stem);
    if let Some((_, label)) = usual {
        return (*label).to_owned();
    }
    let mut words: Vec<String> = stem
        .split('_')
        .map(|word| match word {
            "com" => "centre of mass".to_owned(),
            "delta" => "change of".to_owned(),
            "ixx" | "iyy" | "izz" | "ixy" | "ixz" | "iyz" => format!("inertia {}", &word[1..]),
            "coulomb" => "Coulomb".to_owned(),
            "stribeck" => "Stribeck".to_owned(),
            "q" => "position".to_owned(),
            word => word.to_owned(),
        })
        .collect();
    // `amplitude2` is the amplitude of the second wave.
    if let Some(last) = words.last_mut()
        && let Some(stem) = last.strip_suffix('2')
        && stem.len() > 1
    {
        *last = format!("{stem} (second)");
    }
    sentence_case(&words.join(" "))
}

/// A parameter's value; a number has as many digits as its interval warrants.
pub(super) fn value(value: &Value, interval: Option<[f64; 2]>) -> String {
    match (value, interval) {
        (Value::Number(number), interval) => {
            let number_value = number.as_f64().unwrap_or(f64::NAN);
            match interval {
                Some(interval) => with_digits_of(number_value, interval),
                None => number_text(number_value),
            }
        }
        (Value::String(text), _) => text.clone(),
        (Value::Null, _) => number_text(f64::NAN),
        (other, _) => other.to_string(),
    }
}

/// A number with the digits that its interval's half width warrants: 0.19 and 0.05 have two decimals, 0.4 has one.
pub(super) fn with_digits_of(number: f64, [low, high]: [f64; 2]) -> String {
    let half_width = (high - low).abs() / 2.0;
    if !half_width.is_finite() || half_width == 0.0 || !number.is_finite() {
        return number_text(number);
    }
    let decimals = -(half_width / 3.0).log10().floor() as i32;
    if decimals > 7 || number.abs() >= 1e7 {
        return number_text(number);
    }
    fixed(number, decimals.max(0) as usize)
}

/// A number with three significant digits; a dash if it is not finite.
pub(super) fn number_text(number: f64) -> String {
    if !number.is_finite() {
        return "–".to_owned();
    }
    if number == 0.0 {
        return "0".to_owned();
    }
    let magnitude = number.abs().log10().floor() as i32;
    if !(-4..6).contains(&magnitude) {
        let mantissa = number / 10_f64.powi(magnitude);
        return format!("{} × 10{}", fixed(mantissa, 2), superscript(magnitude));
    }
    fixed(number, (2 - magnitude).max(0) as usize)
}

/// A number with a true minus sign, and no sign if it rounds to zero.
pub(super) fn fixed(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|digit| matches!(digit, b'0' | b'.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => digit
                .to_digit(10)
                .and_then(|value| char::from_u32(0x2070 + value))
                .unwrap_or(digit),
        })
        .collect()
}

/// A fraction as a percentage; a dash if it is not finite.
pub(super) fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "–".to_owned();
    }
    let percent = share * 100.0;
    if percent > 0.0 && percent < 1.0 {
        "< 1 %".to_owned()
    } else {
        format!("{} %", fixed(percent, 0))
    }
}

/// A confidence or a reduction as a percentage, never 100 %.
pub(super) fn almost_all(share: f64) -> String {
    if share > 0.99 {
        "> 99 %".to_owned()
    } else {
        percent(share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_canonical_names() {
        let all = [
            ("coulomb_nm", "Coulomb friction", "N m"),
            ("viscous_nms_per_rad", "Viscous friction", "N m s/rad"),
            ("drag_nms2_per_rad2", "Drag", "N m s²/rad²"),
            ("stribeck_velocity_rad_s", "Stribeck velocity", "rad/s"),
            ("inertia_kgm2", "Inertia", "kg m²"),
            ("com_x_m", "Centre of mass x", "m"),
            ("delta_com_z_m", "Change of centre of mass z", "m"),
            ("ixx_kgm2", "Inertia xx", "kg m²"),
            ("cycles_per_rev", "Cycles", "per turn"),
            ("cycles_per_rev2", "Cycles (second)", "per turn"),
            ("amplitude2_nm", "Amplitude (second)", "N m"),
            ("change_time_session_s", "Changed at, in the session", "s"),
            ("stiffness_n_per_m", "Stiffness", "N/m"),
            ("gain", "Gain", ""),
            ("force_x_n", "Force x", "N"),
            ("cutoff_hz", "Cutoff", "Hz"),
            ("mass_kg", "Mass", "kg"),
        ];
        for (name, label, unit) in all {
            assert_eq!(parameter(name), (label.to_owned(), unit), "{name}");
        }
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        assert_eq!(with_digits_of(4.1234, [3.9, 4.3]), "4.12");
        assert_eq!(with_digits_of(0.012, [0.008, 0.016]), "0.012");
        assert_eq!(with_digits_of(-1234.5, [-1300.0, -1200.0]), "−1234");
        assert_eq!(number_text(0.012_345), "0.0123");
        assert_eq!(number_text(-0.000_001_234), "−1.23 × 10⁻⁶");
        assert_eq!(number_text(f64::NAN), "–");
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(percent(0.634), "63 %");
        assert_eq!(percent(f64::INFINITY), "–");
    }
}
