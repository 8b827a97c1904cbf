//! A picture of the robot: its joints in the mean recorded pose, coloured by their findings.

use maud::{Markup, html};
use tauscope_dynamics::terms::UNKNOWN;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};

use super::chart::r;
use super::effects::effect_title;
use super::groups::{self, Group};
use super::number_format::number_text;
use tauscope_explain::report::{RecordingPicture, Report};

/// Width and height of the picture \[px\].
/// Layout: by eye; no number depends on it.
const SIZE: [f64; 2] = [460.0, 330.0];
/// Width and height of the part with the arm \[px\].
/// Layout: by eye; no number depends on it.
const ARM: [f64; 2] = [210.0, 280.0];
/// Margin around the arm \[px\].
/// Layout: by eye; no number depends on it.
const MARGIN: f64 = 24.0;
/// Radius of a joint's disc \[px\].
/// Layout: by eye; no number depends on it.
const DISC: f64 = 9.0;
/// Smallest distance of two discs \[px\].
/// Layout: by eye; no number depends on it.
const APART: f64 = 21.0;
/// Elevation of the viewpoint \[rad\].
/// Layout: by eye; no number depends on it.
const ELEVATION: f64 = 0.25;
/// Number of labelled places.
/// Layout: by eye; no number depends on it.
const LABELS: usize = 6;

/// A point in the picture \[px\].
type Point = [f64; 2];

/// The arm in the plane of the picture.
struct Drawing {
    /// Origins of the links.
    links: Vec<Point>,
    /// Centres of the joints' discs.
    joints: Vec<Point>,
}

/// The robot with a label for each place of a finding; `None` if it cannot be drawn.
pub(super) fn picture(
    report: &Report,
    model: &Model,
    pictures: &[RecordingPicture],
) -> Option<Markup> {
    if model.dof() == 0 || model.dof() != report.joints.len() {
        return None;
    }
    let drawing = Drawing::new(model, &pose(model, pictures))?;
    let groups = groups::of(report);
    let largest = groups.iter().map(|group| group.effort).fold(0.0, f64::max);
    let mut labels: Vec<(Point, &Group<'_>)> = groups
        .iter()
        .take(LABELS)
        .filter_map(|group| Some((drawing.place(model, group)?, group)))
        .collect();
    labels.sort_by(|a, b| a.0[1].total_cmp(&b.0[1]));
    let pitch = (SIZE[1] - 40.0) / labels.len().max(1) as f64;
    Some(html! {
        figure.robot {
            svg viewBox={ "0 0 " (SIZE[0]) " " (SIZE[1]) } role="img" aria-label="the robot, its joints coloured by their findings" {
                @for (child, link) in model.links().iter().enumerate() {
                    @if let Some(parent) = link.parent {
                        (segment(drawing.links[parent], drawing.links[child]))
                    }
                }
                @for (index, (at, group)) in labels.iter().enumerate() {
                    @let y = 30.0 + pitch * (index as f64 + 0.5) - 0.25 * pitch;
                    (leader(*at, [ARM[0] + 2.0 * MARGIN + 4.0, y]))
                    (label(group, y, report.effort_unit_at(group.joint)))
                }
                @for (at, group) in labels.iter().filter(|(_, group)| group.joint.is_none()) {
                    rect.found x=(r(at[0] - 7.0)) y=(r(at[1] - 7.0)) width="14" height="14" rx="3"
                        style=(heat(group, largest)) { title { (group.title()) } }
                }
                @for (joint, at) in drawing.joints.iter().enumerate() {
                    @let group = groups.iter().find(|group| group.is_joint(&report.joints[joint]));
                    (disc(*at, joint, &report.joints[joint], group, largest))
                }
            }
            figcaption { "Joints are numbered from the base. A fuller disc means that the findings at this joint need more effort. Squares are links." }
        }
    })
}

/// Mean recorded joint positions; without recordings the middle of the joints' ranges.
fn pose(model: &Model, pictures: &[RecordingPicture]) -> Vec<f64> {
    let mean = |values: &[f64]| {
        let finite = values.iter().filter(|value| value.is_finite());
        let (sum, count) =
            finite.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    let recorded = |joint: usize| mean(&pictures.first()?.joints.get(joint)?.position);
    let joints = model.joints().iter().enumerate();
    joints
        .map(|(index, joint)| {
            let (lower, upper) = (joint.limits.lower, joint.limits.upper);
            let middle = lower
                .zip(upper)
                .map_or(0.0, |(low, high)| f64::midpoint(low, high));
            recorded(index).unwrap_or(if middle.is_finite() { middle } else { 0.0 })
        })
        .collect()
}

impl Drawing {
    fn new(model: &Model, pose: &[f64]) -> Option<Self> {
        let mut data = Data::new(model);
        forward_kinematics(model, &mut data, pose);
        let origin =
            |link: usize| -> [f64; 3] { link_pose(model, &data, link).translation.vector.into() };
        let space: Vec<[f64; 3]> = (0..model.links().len()).map(origin).collect();
        let flat = seen_from_the_side(&space);
        let fitted = fitted(&flat)?;
        let children = model.joints().iter().map(|joint| fitted[joint.child_link]);
        let mut joints: Vec<Point> = children.collect();
        spread(&mut joints);
        let mut links = fitted;
        for (joint, at) in model.joints().iter().zip(&joints) {
            links[joint.child_link] = *at;
        }
        Some(Self { links, joints })
    }

    /// Position of a group's mark: at its joint, or halfway along its link.
    fn place(&self, model: &Model, group: &Group<'_>) -> Option<Point> {
        if let Some(joint) = group.joint {
            return self.joints.get(model.joint_index(joint)?).copied();
        }
        let link = model.link_index(group.link?)?;
        let own = self.links[link];
        let is_child = |child: &usize| model.links()[*child].parent == Some(link);
        let child = (0..model.links().len()).find(is_child);
        Some(match child.map(|child| self.links[child]) {
            Some(end) => [f64::midpoint(own[0], end[0]), f64::midpoint(own[1], end[1])],
            // At the end of the arm, slightly beyond the last disc.
            None => [own[0] + 12.0, own[1] - 12.0],
        })
    }
}

/// Projects points onto a plane along the arm's widest horizontal direction, seen from slightly above.
fn seen_from_the_side(points: &[[f64; 3]]) -> Vec<Point> {
    let count = points.len().max(1) as f64;
    let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / count;
    let (mx, my) = (mean(0), mean(1));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for [x, y, _] in points {
        xx += (x - mx).powi(2);
        xy += (x - mx) * (y - my);
        yy += (y - my).powi(2);
    }
    let wide = 0.5 * (2.0 * xy).atan2(xx - yy);
    let (sin, cos) = wide.sin_cos();
    let project = |[x, y, z]: &[f64; 3]| {
        let (across, away) = (cos * x + sin * y, cos * y - sin * x);
        // Pixels count downwards.
        [across, -(ELEVATION.cos() * z + ELEVATION.sin() * away)]
    };
    points.iter().map(project).collect()
}

/// Scales and moves the points into the part of the picture with the arm.
fn fitted(points: &[Point]) -> Option<Vec<Point>> {
    let range = |axis: usize| {
        let values = points.iter().map(|p| p[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    };
    let [(left, right), (top, bottom)] = [range(0), range(1)];
    let extent = (right - left).max(bottom - top);
    if !extent.is_finite() || extent <= 0.0 {
        return None;
    }
    let scale = (ARM[0] / (right - left).max(1e-9)).min(ARM[1] / (bottom - top).max(1e-9));
    let room = [
        0.5 * (ARM[0] - scale * (right - left)),
        0.5 * (ARM[1] - scale * (bottom - top)),
    ];
    let place = |[x, y]: &Point| {
        [
            MARGIN + room[0] + scale * (x - left),
            MARGIN + room[1] + scale * (y - top),
        ]
    };
    Some(points.iter().map(place).collect())
}

/// Moves overlapping discs apart, such as those of a wrist.
fn spread(points: &mut [Point]) {
    /// Number of relaxation rounds. Resolution: more rounds move no disc by a pixel.
    const ROUNDS: usize = 60;
    for _ in 0..ROUNDS {
        for a in 0..points.len() {
            for b in a + 1..points.len() {
                let apart = [points[b][0] - points[a][0], points[b][1] - points[a][1]];
                let distance = apart[0].hypot(apart[1]);
                if distance >= APART {
                    continue;
                }
                // Coinciding discs are spread upwards, the outer joint higher.
                let [dx, dy] = if distance > 1e-6 {
                    apart.map(|d| d / distance)
                } else {
                    [0.5, -0.87]
                };
                let push = 0.5 * (APART - distance);
                points[a] = [points[a][0] - push * dx, points[a][1] - push * dy];
                points[b] = [points[b][0] + push * dx, points[b][1] + push * dy];
            }
        }
    }
    for [x, y] in points {
        *x = x.clamp(DISC + 2.0, ARM[0] + 2.0 * MARGIN - DISC - 2.0);
        *y = y.clamp(DISC + 2.0, SIZE[1] - DISC - 2.0);
    }
}

fn segment(from: Point, to: Point) -> Markup {
    html! { line.bone x1=(r(from[0])) y1=(r(from[1])) x2=(r(to[0])) y2=(r(to[1])) {} }
}

fn leader(from: Point, to: Point) -> Markup {
    html! { line.leader x1=(r(from[0])) y1=(r(from[1])) x2=(r(to[0])) y2=(r(to[1])) {} }
}

fn disc(at: Point, joint: usize, name: &str, group: Option<&Group<'_>>, largest: f64) -> Markup {
    let class = match group {
        Some(group) if group.findings.iter().any(|f| f.known_as() == UNKNOWN.name) => {
            "joint unknown"
        }
        Some(_) => "joint found",
        None => "joint",
    };
    let style = group.map_or(String::new(), |group| heat(group, largest));
    html! {
        g {
            title { (name) }
            circle class=(class) cx=(r(at[0])) cy=(r(at[1])) r=(r(DISC)) style=(style) {}
            text.mid x=(r(at[0])) y=(r(at[1] + 3.5)) { (joint + 1) }
        }
    }
}

/// Fill of a mark: full at the largest effort, never less than a third.
fn heat(group: &Group<'_>, largest: f64) -> String {
    let share = if largest > 0.0 && group.effort.is_finite() {
        (group.effort / largest).clamp(0.0, 1.0)
    } else {
        1.0
    };
    format!("--heat:{:.0}%", 35.0 + 65.0 * share)
}

fn label(group: &Group<'_>, y: f64, unit: &str) -> Markup {
    /// Number of characters above which a label is cut.
    /// Layout: by eye; no number depends on it.
    const LETTERS: usize = 27;
    let x = r(ARM[0] + 2.0 * MARGIN + 8.0);
    let what: Vec<String> = group
        .findings
        .iter()
        .map(|f| effect_title(f.known_as()))
        .collect();
    let mut what = what.join(", ");
    if what.chars().count() > LETTERS {
        what = what.chars().take(LETTERS - 1).collect::<String>() + "…";
    }
    html! {
        text.name x=(x) y=(r(y)) {
            (group.title())
            @if group.effort > 0.0 { " · " (number_text(group.effort)) " " (unit) }
        }
        text x=(x) y=(r(y + 15.0)) { (what) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_discs_cover_each_other() {
        let mut points = vec![[100.0, 100.0]; 4];
        points.push([104.0, 98.0]);
        spread(&mut points);
        for (a, p) in points.iter().enumerate() {
            for q in &points[..a] {
                let distance = (p[0] - q[0]).hypot(p[1] - q[1]);
                assert!(distance > 2.0 * DISC - 1.0, "{points:?}");
            }
        }
    }

    #[test]
    fn a_robot_without_extent_is_not_drawn() {
        assert!(fitted(&[[1.0, 2.0]]).is_none());
        let fitted = fitted(&[[0.0, 0.0], [0.0, 2.0]]).unwrap_or_default();
        assert!((fitted[1][1] - fitted[0][1] - ARM[1]).abs() < 1e-9);
    }
}
