//! A six-joint arm whose links a test may change, and what is found in it.

#![allow(dead_code, reason = "each test program uses a part")]

use tauscope_dynamics::{
    BodyFinding, BodySeverity, Inertia, Model, check_bodies, with_plausible_bodies,
};

/// A link: name, mass, centre of mass, inertia, and the vector to the next joint.
pub type LinkSpec = (&'static str, f64, [f64; 3], [f64; 6], [f64; 3]);

/// A six-joint arm, 1.2 m long.
pub const ARM: [LinkSpec; 6] = [
    (
        "shoulder",
        3.8,
        [0.0, 0.01, -0.02],
        [0.0112, 0.0, 0.0, 0.0109, 0.0, 0.0071],
        [0.0, 0.13, 0.0],
    ),
    (
        "upper",
        8.2,
        [0.0, 0.0, 0.21],
        [0.142, 0.0, 0.0, 0.139, 0.0, 0.0155],
        [0.0, -0.12, 0.42],
    ),
    (
        "fore",
        2.6,
        [0.0, 0.0, 0.19],
        [0.0471, 0.0, 0.0, 0.0466, 0.0, 0.0049],
        [0.0, 0.0, 0.39],
    ),
    (
        "wrist_1",
        1.3,
        [0.0, 0.055, 0.01],
        [0.0021, 0.0, 0.0, 0.0013, 0.0, 0.0019],
        [0.0, 0.09, 0.0],
    ),
    (
        "wrist_2",
        1.2,
        [0.0, -0.01, 0.05],
        [0.0018, 0.0, 0.0, 0.0017, 0.0, 0.0011],
        [0.0, 0.0, 0.095],
    ),
    (
        "wrist_3",
        0.4,
        [0.0, 0.0, 0.03],
        [0.00025, 0.0, 0.0, 0.00024, 0.0, 0.00018],
        [0.0, 0.0, 0.05],
    ),
];
/// Line of the first `<inertial>`; each link has six lines.
pub const FIRST_LINE: u32 = 4;

/// The URDF of the links, one a joint, with a flange at the end.
pub fn urdf(links: &[LinkSpec]) -> String {
    let mut xml = String::from("<robot name='arm'>\n<link name='base'/>\n");
    let mut before = ("base", [0.0, 0.0, 0.16]);
    let spaced = |v: [f64; 3]| v.map(|x| x.to_string()).join(" ");
    for &(name, mass, com, [xx, xy, xz, yy, yz, zz], next) in links {
        let (com, origin) = (spaced(com), spaced(before.1));
        xml += &format!(
            "<link name='{name}'>\n<inertial>\n<origin xyz='{com}' rpy='0 0 0'/>\n<mass value='{mass}'/>\n\
             <inertia ixx='{xx}' ixy='{xy}' ixz='{xz}' iyy='{yy}' iyz='{yz}' izz='{zz}'/></inertial></link>\n\
             <joint name='{name}_joint' type='continuous'><parent link='{}'/><child link='{name}'/>\
             <origin xyz='{origin}'/><axis xyz='0 1 0'/></joint>\n",
            before.0
        );
        before = (name, next);
    }
    xml += &format!(
        "<link name='flange'/><joint name='flange_joint' type='fixed'><parent link='{}'/><child link='flange'/>\
         <origin xyz='{}'/></joint>\n</robot>\n",
        before.0,
        spaced(before.1)
    );
    xml
}

/// The arm with changed links.
pub fn arm(change: impl Fn(usize, &mut LinkSpec)) -> String {
    let mut links = ARM;
    for (index, link) in links.iter_mut().enumerate() {
        change(index, link);
    }
    urdf(&links)
}

pub fn impossible(findings: &[BodyFinding]) -> Vec<&BodyFinding> {
    let worst = |finding: &&BodyFinding| finding.severity == BodySeverity::Impossible;
    findings.iter().filter(worst).collect()
}

/// The only finding about the URDF.
pub fn only(xml: &str) -> BodyFinding {
    let mut findings = check_bodies(xml).unwrap();
    assert_eq!(findings.len(), 1, "{findings:#?}");
    findings.remove(0)
}

/// The inertia of a link of the URDF about its centre of mass, once impossible numbers are substituted.
pub fn substituted(xml: &str, link: &str) -> Inertia {
    let findings = check_bodies(xml).unwrap();
    let text = with_plausible_bodies(xml, &findings).unwrap();
    let again = check_bodies(&text).unwrap();
    assert!(impossible(&again).is_empty(), "{again:#?}");
    let model = Model::from_urdf(&text).unwrap();
    model.links()[model.link_index(link).unwrap()].inertia
}

pub fn diagonal(inertia: &Inertia) -> [f64; 3] {
    let [xx, _, _, yy, _, zz] = inertia.inertia_about_com_kgm2();
    [xx, yy, zz]
}

pub fn assert_within(factor: f64, found: [f64; 3], truth: [f64; 3]) {
    for (found, truth) in found.iter().zip(truth) {
        assert!(
            (1.0 / factor..factor).contains(&(found / truth)),
            "{found} for {truth}"
        );
    }
}
