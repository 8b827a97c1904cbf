//! Units of parameters, from their canonical names.

/// Unit of a parameter, from its canonical name.
pub fn unit(parameter: &str) -> &'static str {
    for (ending, unit) in [
        ("_nms2_per_rad2", "N m s²/rad²"),
        ("_nms_per_rad", "N m s/rad"),
        ("_nm_per_rad", "N m/rad"),
        ("_n_per_m", "N/m"),
        ("_rad_s", "rad/s"),
        ("_kgm2", "kg m²"),
        ("_kgm", "kg m"),
        ("_rad", "rad"),
        ("_nm", "N m"),
        ("_kg", "kg"),
        ("_hz", "Hz"),
        ("_s", "s"),
        ("_m", "m"),
        ("_n", "N"),
    ] {
        if parameter.ends_with(ending) {
            return unit;
        }
    }
    ""
}

/// Whether a parameter is so much effort, or so much of it by something.
pub fn is_of_effort(parameter: &str) -> bool {
    let unit = unit(parameter);
    unit.starts_with("N m") || unit == "kg m²"
}

/// Whether a parameter of a body or a force grows with the effort that it is read from.
pub fn grows_with_effort(parameter: &str) -> bool {
    let whole = ["mass_kg", "stiffness_n_per_m"].contains(&parameter);
    whole || parameter.starts_with("force_") || parameter.starts_with("delta_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_names() {
        for (name, expected) in [
            ("coulomb_nm", "N m"),
            ("viscous_nms_per_rad", "N m s/rad"),
            ("delay_s", "s"),
            ("gain", ""),
            ("delta_com_x_m", "m"),
            ("stribeck_velocity_rad_s", "rad/s"),
            ("force_x_n", "N"),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }
}
