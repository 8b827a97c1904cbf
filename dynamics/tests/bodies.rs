//! Physical consistency of the bodies of a URDF: one test for each kind of fault.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::float_cmp, reason = "numbers are read as they are written")]

use tauscope_dynamics::{BodyFault, BodySeverity, check_bodies, with_plausible_bodies};

mod arm;
use arm::{ARM, FIRST_LINE, arm, assert_within, diagonal, impossible, only, substituted, urdf};

#[test]
fn a_sound_arm_has_no_finding_and_keeps_its_text() {
    let xml = urdf(&ARM);
    assert_eq!(check_bodies(&xml).unwrap(), []);
    assert_eq!(with_plausible_bodies(&xml, &[]).unwrap(), xml);
}

#[test]
fn the_bundled_robots_are_sound() {
    let tests = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests");
    for robot in [
        "data/demo_arm",
        "proof/robots/six",
        "proof/robots/seven",
        "proof/robots/slide",
    ] {
        let xml = std::fs::read_to_string(tests.join(robot).with_extension("urdf")).unwrap();
        assert_eq!(check_bodies(&xml).unwrap(), [], "{robot}");
    }
}

#[test]
fn a_decimal_slip_breaks_the_triangle_inequality_and_is_named() {
    let xml = arm(|index, link| {
        if index == 0 {
            link.3[5] = 7.1;
        }
    });
    let found = only(&xml);
    assert_eq!(found.severity, BodySeverity::Impossible);
    assert_eq!((found.link(), found.line()), ("shoulder", FIRST_LINE + 3));
    assert_eq!(
        found.to_string(),
        "line 7: The inertia of link `shoulder` is impossible. Its largest principal moment is 7.1 kg m². It cannot exceed the \
         sum of the other two (0.0112 + 0.0109 = 0.0221 kg m²). izz=\"7.1\" may be a decimal slip: izz=\"0.0071\" would be \
         possible. Check the data sheet. The twin uses the inertia of a uniform cylinder of the same mass instead (principal \
         moments 0.0159, 0.0159, 0.0136 kg m²). Until the file is correct, results are provisional: correct it and run the \
         command again."
    );
    let body = substituted(&xml, "shoulder");
    assert_within(3.0, diagonal(&body), [0.0112, 0.0109, 0.0071]);
    assert_eq!(body.mass_kg(), 3.8);
    // All but the numbers of one <inertia> is as it was.
    let text = with_plausible_bodies(&xml, &[found]).unwrap();
    let differ: Vec<usize> = (xml.lines().zip(text.lines()).enumerate())
        .filter_map(|(line, (before, after))| (before != after).then_some(line + 1))
        .collect();
    assert_eq!(differ, [7]);
    assert_eq!(xml.lines().count(), text.lines().count());
}

#[test]
fn six_numbers_in_the_order_of_a_matrix_are_not_positive_definite() {
    let xml = arm(|index, link| {
        if index == 1 {
            // The rows xx xy xz, yx yy yz.
            link.3 = [0.142, 0.001, 0.0, 0.001, 0.139, 0.0];
        }
    });
    let found = only(&xml);
    assert_eq!((found.link(), found.line()), ("upper", 13));
    let text = found.to_string();
    assert!(
        text.contains("its smallest principal moment is -0.139 kg m²"),
        "{text}"
    );
    let rows = "Its attributes ixx=\"0.142\" ixy=\"0.001\" ixz=\"0\" iyy=\"0.001\" iyz=\"0.139\" izz=\"0\" look like the first two rows";
    assert!(text.contains(rows), "{text}");
    assert_within(
        3.0,
        diagonal(&substituted(&xml, "upper")),
        [0.142, 0.139, 0.0155],
    );
}

#[test]
fn a_slight_excess_is_no_finding_a_clear_one_is_odd() {
    let with = |zz: f64| {
        arm(|index, link| {
            if index == 0 {
                link.3[5] = zz;
            }
        })
    };
    // The other two add up to 0.0221.
    assert_eq!(check_bodies(&with(0.0232)).unwrap(), []);
    let odd = only(&with(0.0300));
    assert_eq!(odd.severity, BodySeverity::Odd);
    assert_eq!(odd.substitutes, []);
    let text = odd.to_string();
    assert!(
        text.contains("is that of no real body. Its largest"),
        "{text}"
    );
    assert!(
        text.ends_with("The twin uses the numbers as they are."),
        "{text}"
    );
    // One digit each: 0.014, 0.014 and 0.026 would be printed so.
    let rounded = arm(|index, link| {
        if index == 0 {
            link.3 = [0.01, 0.0, 0.0, 0.01, 0.0, 0.03];
        }
    });
    assert_eq!(check_bodies(&rounded).unwrap(), []);
}

#[test]
fn one_inertia_in_another_unit_is_too_large_for_its_link() {
    let xml = arm(|index, link| {
        if index == 2 {
            link.3 = link.3.map(|x| x * 1e6);
        }
    });
    let found = only(&xml);
    assert_eq!(
        (found.severity, found.link()),
        (BodySeverity::Impossible, "fore")
    );
    let text = found.to_string();
    assert!(
        text.contains("Its radius of gyration is 135 m for a mass of 2.6 kg"),
        "{text}"
    );
    assert_within(
        3.0,
        diagonal(&substituted(&xml, "fore")),
        [0.0471, 0.0466, 0.0049],
    );
}

#[test]
fn inertias_that_are_all_in_another_unit_are_converted() {
    for (unit, factor) in [
        ("kg mm²", 1e6),
        ("kg cm²", 1e4),
        ("g mm²", 1e9),
        ("g cm²", 1e7),
    ] {
        let xml = arm(|_, link| link.3 = link.3.map(|x| x * factor));
        let found = only(&xml);
        let text = found.to_string();
        assert_eq!(found.links.len(), 6);
        assert!(
            text.contains(&format!(
                "They are probably in {unit}: convert them to kg m²."
            )),
            "{text}"
        );
        assert!(text.ends_with("The twin converts them."), "{text}");
        assert_eq!(
            diagonal(&substituted(&xml, "fore")).map(rounded),
            [0.0471, 0.0466, 0.0049]
        );
    }
}

fn rounded(x: f64) -> f64 {
    format!("{x:.8}").parse().unwrap()
}

#[test]
fn masses_in_g_are_converted_with_or_without_the_inertias() {
    let both = arm(|_, link| {
        link.1 *= 1e3;
        link.3 = link.3.map(|x| x * 1e9);
    });
    let found = only(&both);
    let text = found.to_string();
    assert!(
        text.contains("They are probably in g and g mm²: convert them to kg and kg m²."),
        "{text}"
    );
    let masses = arm(|_, link| link.1 *= 1e3);
    let found = only(&masses);
    assert!(
        matches!(found.fault, BodyFault::MassUnit { .. }),
        "{found:?}"
    );
    for xml in [both, masses] {
        let body = substituted(&xml, "fore");
        assert_eq!(body.mass_kg(), 2.6);
        assert_eq!(diagonal(&body).map(rounded), [0.0471, 0.0466, 0.0049]);
    }
}

#[test]
fn a_decimal_slip_in_a_file_of_another_unit_has_a_substitute_of_its_own() {
    let xml = arm(|index, link| {
        link.3 = link.3.map(|x| x * 1e6);
        if index == 0 {
            link.3[5] *= 1e3;
        }
    });
    let findings = check_bodies(&xml).unwrap();
    assert_eq!(impossible(&findings).len(), 2, "{findings:#?}");
    assert_within(
        3.0,
        diagonal(&substituted(&xml, "shoulder")),
        [0.0112, 0.0109, 0.0071],
    );
    assert_eq!(
        diagonal(&substituted(&xml, "upper")).map(rounded),
        [0.142, 0.139, 0.0155]
    );
}

#[test]
fn a_centre_of_mass_in_mm_is_read_as_mm() {
    let xml = arm(|index, link| {
        if index == 1 {
            link.2 = link.2.map(|x| x * 1e3);
        }
    });
    let found = only(&xml);
    assert_eq!(found.severity, BodySeverity::Impossible);
    assert!(
        found.to_string().contains("is 210 m from the link's frame"),
        "{found}"
    );
    assert_eq!(substituted(&xml, "upper").com_m(), [0.0, 0.0, 0.21]);
    let far = arm(|index, link| {
        if index == 5 {
            link.2 = [0.0, 0.0, 1.3];
        }
    });
    assert_eq!(only(&far).severity, BodySeverity::Odd);
}

#[test]
fn lengths_in_mm_are_named_once() {
    for centres in [1.0, 1e3] {
        let xml = arm(|_, link| {
            link.4 = link.4.map(|x| x * 1e3);
            link.2 = link.2.map(|x| x * centres);
        });
        let found = only(&xml);
        assert!(
            found
                .to_string()
                .contains("is too long for the inertias of its links"),
            "{found}"
        );
        assert_eq!((found.links.len(), found.substitutes.len()), (6, 0));
    }
}

#[test]
fn placeholders_are_named_once() {
    let ones = arm(|_, link| link.3 = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    let found = only(&ones);
    assert_eq!(found.severity, BodySeverity::Impossible);
    let text = found.to_string();
    assert!(
        text.starts_with(
            "line 7: 6 of 6 moving links have the same inertia (1, 1, 1 kg m²): links `shoulder`, `upper`, `fore` and 3 \
             more. It is probably a placeholder"
        ),
        "{text}"
    );
    assert_within(
        3.0,
        diagonal(&substituted(&ones, "fore")),
        [0.0471, 0.0466, 0.0049],
    );
    let plausible = arm(|_, link| link.3 = [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]);
    assert_eq!(only(&plausible).severity, BodySeverity::Odd);
    let masses = arm(|_, link| link.1 = 1.0);
    let found = only(&masses);
    assert_eq!(found.severity, BodySeverity::Odd);
    assert!(
        found
            .to_string()
            .contains("6 of 6 moving links have the same mass, 1 kg"),
        "{found}"
    );
}

#[test]
fn point_masses_and_inertias_without_a_mass_are_remarks() {
    let points = arm(|index, link| {
        if index > 2 {
            link.3 = [0.0; 6];
        }
    });
    let found = only(&points);
    assert_eq!((found.severity, found.links.len()), (BodySeverity::Odd, 3));
    assert!(
        found.to_string().contains("is at one point or nearly so"),
        "{found}"
    );
    let xml = urdf(&ARM).replace(
        "<link name='flange'/>",
        "<link name='flange'><inertial><mass value='0'/>\
         <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link>",
    );
    let found = only(&xml);
    assert_eq!(
        (found.severity, found.link()),
        (BodySeverity::Odd, "flange")
    );
    assert!(
        found
            .to_string()
            .contains("Link `flange` has no mass, but an inertia"),
        "{found}"
    );
}

#[test]
fn what_has_no_effect_is_not_checked() {
    let negative = |mass: f64, size: f64| {
        format!(
            "<inertial><mass value='{mass}'/><inertia ixx='-{size}' ixy='0' ixz='0' iyy='{size}' iyz='0' izz='{size}'/>\
             </inertial>"
        )
    };
    for (from, to) in [
        (
            "<link name='base'/>",
            format!("<link name='base'>{}</link>", negative(5.0, 1.0)),
        ),
        (
            "<link name='flange'/>",
            format!("<link name='flange'>{}</link>", negative(1e-3, 1e-9)),
        ),
    ] {
        assert_eq!(check_bodies(&urdf(&ARM).replace(from, &to)).unwrap(), []);
    }
    let heavy = format!("<link name='flange'>{}</link>", negative(1.0, 0.01));
    let xml = urdf(&ARM).replace("<link name='flange'/>", &heavy);
    assert_eq!(only(&xml).link(), "flange");
}

#[test]
fn shapes_and_strokes_count_as_the_length_of_a_link() {
    let rod = "<inertial><mass value='2'/><inertia ixx='0.66' ixy='0' ixz='0' iyy='0.66' iyz='0' izz='0.01'/></inertial>";
    let with = |shape: &str, joint: &str| {
        format!(
            "<robot name='r'><link name='base'/><link name='rod'>{rod}{shape}</link><joint name='j' {joint}>\
             <parent link='base'/><child link='rod'/></joint></robot>"
        )
    };
    assert_eq!(only(&with("", "type='continuous'")).link(), "rod");
    for shape in [
        "<collision><geometry><box size='0.1 0.1 2'/></geometry></collision>",
        "<visual><geometry><cylinder radius='0.05' length='2'/></geometry></visual>",
    ] {
        assert_eq!(check_bodies(&with(shape, "type='continuous'")).unwrap(), []);
    }
    let slide = with("", "type='prismatic'").replace(
        "<child link='rod'/>",
        "<child link='rod'/><limit lower='-1' upper='1' velocity='1' effort='1'/>",
    );
    assert_eq!(check_bodies(&slide).unwrap(), []);
}

#[test]
fn extreme_numbers_end_in_an_answer() {
    for x in [1e308, -1e308, 1e-308, f64::MIN_POSITIVE, 1e154] {
        for k in 0..6 {
            let xml = arm(|index, link| {
                if index == 0 {
                    link.3[k] = x;
                }
            });
            let findings = check_bodies(&xml).unwrap();
            with_plausible_bodies(&xml, &findings).unwrap();
            let mass = arm(|index, link| {
                if index == 0 {
                    link.1 = x.abs();
                }
            });
            let findings = check_bodies(&mass).unwrap();
            with_plausible_bodies(&mass, &findings).unwrap();
        }
    }
    assert_eq!(check_bodies("<robot name='r'/>").unwrap(), []);
    assert!(check_bodies("no XML").is_err());
    assert!(with_plausible_bodies("no XML", &[]).is_err());
}
