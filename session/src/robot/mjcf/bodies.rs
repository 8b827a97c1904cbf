//! Masses and shapes of a MuJoCo model's bodies.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use mjcf_rs::Model;
use mjcf_rs::body::{Body, Geom, GeomType, InertiaSpec};
use mjcf_rs::compiler::InertiaFromGeom;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tauscope_dynamics::Inertia;

use super::text::{escaped, isometry, origin};

/// A body whose mass is not in the file.
#[derive(Debug, thiserror::Error)]
pub enum NoInertia {
    /// It follows from a mesh.
    #[error("the mass of body `{0}`, which has no <inertial> and a mesh")]
    OfMesh(String),
    /// It moves without any, which MuJoCo refuses, too.
    #[error("the mass of body `{0}`, which moves and has neither <inertial> nor geoms with a mass")]
    Massless(String),
}

/// The inertia of a body in its own frame; `None` where it has no mass.
///
/// # Errors
/// If it follows from a mesh.
pub fn inertia(model: &Model, body: &Body, name: &str) -> Result<Option<Inertia>, NoInertia> {
    let from_geoms = match model.compiler.inertia_from_geom {
        InertiaFromGeom::True => true,
        InertiaFromGeom::False => false,
        InertiaFromGeom::Auto => body.inertial.is_none(),
    };
    if let Some(own) = body.inertial.as_ref().filter(|_| !from_geoms) {
        let about = match own.inertia {
            InertiaSpec::Diagonal([xx, yy, zz]) => [xx, 0.0, 0.0, yy, 0.0, zz],
            InertiaSpec::Full([xx, yy, zz, xy, xz, yz]) => [xx, xy, xz, yy, yz, zz],
        };
        let there = Inertia::new(own.mass, [0.0; 3], about);
        return Ok((own.mass > 0.0).then(|| there.transformed(&isometry(&own.pose))));
    }
    if !from_geoms {
        return Ok(None);
    }
    let mut sum = Inertia::zero();
    for geom in &body.geoms {
        let weighs = geom.mass.is_none_or(|mass| mass > 0.0)
            && geom.density.is_none_or(|density| density > 0.0);
        let is_solid = !matches!(geom.type_, GeomType::Plane | GeomType::Hfield);
        if !weighs || !is_solid {
            continue;
        }
        let Some(solid) = Solid::of(geom) else {
            return Err(NoInertia::OfMesh(name.to_owned()));
        };
        let density = geom.density.unwrap_or(model.compiler.inertia_density);
        let mass = geom.mass.unwrap_or(density * solid.volume_m3());
        let [xx, yy, zz] = solid.moments_m2().map(|moment| mass * moment);
        let there = Inertia::new(mass, [0.0; 3], [xx, 0.0, 0.0, yy, 0.0, zz]);
        sum += there.transformed(&solid.at);
    }
    Ok((sum.mass_kg() > 0.0).then_some(sum))
}

/// A geometric solid with its pose in the body's frame.
struct Solid {
    kind: GeomType,
    /// Half sizes, or radius and half length \[m\].
    size: [f64; 3],
    at: Isometry3<f64>,
}

impl Solid {
    /// The solid of a geom; `None` for those of a file.
    fn of(geom: &Geom) -> Option<Self> {
        let mut size = geom.size;
        let mut at = isometry(&geom.pose);
        if let Some([x, y, z, u, v, w]) = geom.fromto {
            let (from, to) = (Vector3::new(x, y, z), Vector3::new(u, v, w));
            let along = to - from;
            let half = 0.5 * along.norm();
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along);
            // Opposite to z there is no shortest turn.
            let turn =
                turn.unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
            at = Isometry3::from_parts(Translation3::from(0.5 * (from + to)), turn);
            match geom.type_ {
                GeomType::Box | GeomType::Ellipsoid => size = [size[0], size[0], half],
                _ => size[1] = half,
            }
        }
        let is_known = matches!(
            geom.type_,
            GeomType::Sphere
                | GeomType::Capsule
                | GeomType::Ellipsoid
                | GeomType::Cylinder
                | GeomType::Box
        );
        is_known.then_some(Self {
            kind: geom.type_,
            size,
            at,
        })
    }

    fn volume_m3(&self) -> f64 {
        let [a, b, c] = self.size;
        match self.kind {
            GeomType::Sphere => 4.0 / 3.0 * PI * a.powi(3),
            GeomType::Capsule => PI * a * a * (4.0 / 3.0 * a + 2.0 * b),
            GeomType::Ellipsoid => 4.0 / 3.0 * PI * a * b * c,
            GeomType::Cylinder => 2.0 * PI * a * a * b,
            _ => 8.0 * a * b * c,
        }
    }

    /// Moments of inertia about the axes by mass \[m²\].
    fn moments_m2(&self) -> [f64; 3] {
        let [a, b, c] = self.size;
        let about = |x: f64, y: f64, z: f64, share: f64| {
            [(y, z), (x, z), (x, y)].map(|(u, v)| share * (u * u + v * v))
        };
        match self.kind {
            GeomType::Sphere => about(a, a, a, 0.2),
            GeomType::Ellipsoid => about(a, b, c, 0.2),
            GeomType::Cylinder => {
                let across = a * a / 4.0 + b * b / 3.0;
                [across, across, a * a / 2.0]
            }
            GeomType::Capsule => {
                // A cylinder with a half sphere at either end, whose centre of mass is 3/8 of the radius beyond.
                let (round, straight) = (4.0 / 3.0 * a, 2.0 * b);
                let (round, straight) = (round / (round + straight), straight / (round + straight));
                let end = 0.4 * a * a + b * b + 0.75 * a * b;
                let across = straight * (a * a / 4.0 + b * b / 3.0) + round * end;
                [across, across, straight * a * a / 2.0 + round * 0.4 * a * a]
            }
            _ => about(a, b, c, 1.0 / 3.0),
        }
    }
}

/// The `<visual>` elements of a link whose body has the pose `at` in it.
pub fn shapes(model: &Model, folder: &Path, body: &Body, at: &Isometry3<f64>) -> String {
    let mut text = String::new();
    for geom in &body.geoms {
        let solid = Solid::of(geom);
        let [a, b, c] = solid.as_ref().map_or(geom.size, |solid| solid.size);
        let mut place = solid.map_or_else(|| isometry(&geom.pose), |solid| solid.at);
        let drawn = match geom.type_ {
            GeomType::Sphere => format!("<sphere radius=\"{a}\"/>"),
            GeomType::Capsule | GeomType::Cylinder => {
                let round = if geom.type_ == GeomType::Capsule {
                    a
                } else {
                    0.0
                };
                format!(
                    "<cylinder radius=\"{a}\" length=\"{}\"/>",
                    2.0 * (b + round)
                )
            }
            GeomType::Box | GeomType::Ellipsoid => {
                format!("<box size=\"{} {} {}\"/>", 2.0 * a, 2.0 * b, 2.0 * c)
            }
            GeomType::Mesh => {
                let mesh = geom.mesh.as_ref().and_then(|name| model.assets.mesh(name));
                let Some((mesh, file)) =
                    mesh.and_then(|mesh| Some((mesh, model.resolve_mesh_file(mesh, folder)?)))
                else {
                    continue;
                };
                place *= isometry(&mesh.refpose).inverse();
                let [x, y, z] = mesh.scale;
                let file = escaped(&file.display().to_string());
                format!("<mesh filename=\"{file}\" scale=\"{x} {y} {z}\"/>")
            }
            _ => continue,
        };
        let _ = writeln!(
            text,
            "    <visual>\n      {}\n      <geometry>{drawn}</geometry>\n    </visual>",
            origin(&(at * place))
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// Moments of a solid against a sum over a grid of points.
    #[test]
    fn moments_are_those_of_a_sum_over_the_solid() {
        let inside = |kind: GeomType, p: Point3<f64>, [a, b, c]: [f64; 3]| match kind {
            GeomType::Sphere => p.coords.norm() < a,
            GeomType::Ellipsoid => (p.x / a).powi(2) + (p.y / b).powi(2) + (p.z / c).powi(2) < 1.0,
            GeomType::Cylinder => p.x.hypot(p.y) < a && p.z.abs() < b,
            GeomType::Capsule => {
                let beyond = (p.z.abs() - b).max(0.0);
                (p.x * p.x + p.y * p.y + beyond * beyond).sqrt() < a
            }
            _ => p.x.abs() < a && p.y.abs() < b && p.z.abs() < c,
        };
        let (step, reach) = (0.01, 60);
        for kind in [
            GeomType::Sphere,
            GeomType::Ellipsoid,
            GeomType::Cylinder,
            GeomType::Capsule,
            GeomType::Box,
        ] {
            let size = [0.2, 0.3, 0.25];
            let (mut count, mut sum) = (0.0, Vector3::zeros());
            for i in -reach..reach {
                for j in -reach..reach {
                    for k in -reach..reach {
                        let [x, y, z] = [i, j, k].map(|n| step * (f64::from(n) + 0.5));
                        if inside(kind, Point3::new(x, y, z), size) {
                            count += 1.0;
                            sum += Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y);
                        }
                    }
                }
            }
            let solid = Solid {
                kind,
                size,
                at: Isometry3::identity(),
            };
            let volume = count * step.powi(3);
            assert!((solid.volume_m3() / volume - 1.0).abs() < 0.01, "{kind:?}");
            for (found, summed) in solid.moments_m2().iter().zip((sum / count).iter()) {
                assert!(
                    (found / summed - 1.0).abs() < 0.02,
                    "{kind:?}: {found} {summed}"
                );
            }
        }
    }
}
