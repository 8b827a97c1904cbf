//! The robot in the picture: links as simple shapes, moved by the measured positions and coloured while touched.

mod shapes;

use std::collections::BTreeMap;

use rerun::archetypes::{Arrows3D, CoordinateFrame};
use rerun::{EntityPath, Rgba32};
use tauscope_bus::{Header, JointArray};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};

use self::shapes::Shapes;
use super::blueprint::ViewPoint;
use super::palette::{CONTACT, LINK, OTHER_LINK};
use super::store::{Out, Store, entity, unserializable};
use super::tracks::{PoseTrack, Times};
use crate::error::RecordError;
use crate::streams::{CellInfo, root};

/// Smallest interval between poses \[ns\]: 50 per second.
/// Resolution: size of the stream.
const POSE_PERIOD_NS: u64 = 20_000_000;
/// Repetition period of colours, for viewers that connect later \[ns\].
/// Resolution: size of the stream, against the waiting time of such a viewer.
const COLOUR_PERIOD_NS: u64 = 1_000_000_000;

/// A drawn robot.
#[derive(Debug)]
pub(super) struct Robot {
    entity: EntityPath,
    model: Model,
    data: Data,
    links: Vec<DrawnLink>,
    poses: PoseTrack,
    posed_ns: Option<i64>,
    coloured_ns: Option<i64>,
    /// Touched link by the detector of each stream.
    touched: BTreeMap<usize, usize>,
    /// Bounding box of the links' origins so far, as (lower, upper) corner \[m\].
    bounds: [[f64; 3]; 2],
}

#[derive(Debug)]
struct DrawnLink {
    index: usize,
    name: String,
    frame: String,
    entity: EntityPath,
    shapes: Shapes,
    colour: Rgba32,
    /// Times and values of the shown colours.
    times: Times,
    shown: Vec<Rgba32>,
}

impl Robot {
    /// Creates a robot and sends the messages with the shapes of its links; `times` creates the times of its tracks.
    pub fn new(
        model: &Model,
        prefix: &str,
        times: impl Fn() -> Times,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        Self::on(frame(prefix, root(model)), model, prefix, times, store, out)
    }

    /// Another robot on the base of this one.
    pub fn beside(
        &self,
        prefix: &str,
        times: impl Fn() -> Times,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        let base = frame("", root(&self.model));
        Self::on(base, &self.model, prefix, times, store, out)
    }

    /// Draws the parts of a robot whose base has the frame `root`.
    fn on(
        root: String,
        model: &Model,
        prefix: &str,
        times: impl Fn() -> Times,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        let base = entity(prefix, &["robot"]);
        out(store.always(&base, &CoordinateFrame::new(root.as_str()))?)?;
        let mut links = Vec::new();
        for (index, shapes) in shapes::of(model).into_iter().enumerate() {
            if shapes.is_empty() {
                continue;
            }
            let name = model.links()[index].name.clone();
            let (frame, entity) = (frame(prefix, &name), entity(prefix, &["robot", &name]));
            out(store.always(&entity, &CoordinateFrame::new(frame.as_str()))?)?;
            shapes.draw(&entity, store, out)?;
            let colour = if links.len() % 2 == 0 {
                LINK
            } else {
                OTHER_LINK
            };
            links.push(DrawnLink {
                index,
                name,
                frame,
                entity,
                shapes,
                colour,
                times: times(),
                shown: Vec::new(),
            });
        }
        let mut robot = Self {
            entity: base,
            data: Data::new(model),
            model: model.clone(),
            links,
            poses: PoseTrack::new(entity(prefix, &["transforms"]), root, times()),
            posed_ns: None,
            coloured_ns: None,
            touched: BTreeMap::new(),
            bounds: [[0.0; 3]; 2],
        };
        robot.compute(&[0.0; tauscope_bus::MAX_JOINTS]);
        for link in &robot.links {
            grow(
                &mut robot.bounds,
                position(&robot.model, &robot.data, link.index),
            );
        }
        Ok(robot)
    }

    /// Sets the frame and style of an entity of arrows.
    pub fn prepare_arrows(
        cell: &CellInfo,
        prefix: &str,
        arrows: &EntityPath,
        colours: &[Rgba32],
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<(), RecordError> {
        if cell.model.is_some() {
            out(store.always(arrows, &CoordinateFrame::new(frame(prefix, cell.root())))?)?;
        }
        let looks = Arrows3D::update_fields()
            .with_colors(colours.iter().copied())
            .with_radii([0.012_f32]);
        out(store.always(arrows, &looks)?)
    }

    /// Parent entity of all links.
    pub fn entity(&self) -> &EntityPath {
        &self.entity
    }

    /// Content of a view of the robot: the links and the forces on them.
    pub fn contents(&self) -> [String; 2] {
        let parent = self.entity.parent().unwrap_or_else(EntityPath::root);
        let forces = parent.join(&EntityPath::from_single_string("external_wrench"));
        [format!("{}/**", self.entity), format!("{forces}/**")]
    }

    /// View point that shows the whole volume in which the links have moved so far.
    pub fn view_point(&self) -> ViewPoint {
        let [low, high] = self.bounds;
        let size = (0..3)
            .map(|i| (high[i] - low[i]).powi(2))
            .sum::<f64>()
            .sqrt()
            .max(0.2);
        let middle: [f64; 3] = std::array::from_fn(|i| 0.5 * (low[i] + high[i]));
        // From the front and the side, slightly above.
        let towards_eye = [0.85, -0.75, 0.25];
        ViewPoint {
            eye_m: std::array::from_fn(|i| (middle[i] + size * towards_eye[i]) as f32),
            target_m: middle.map(|metre| metre as f32),
        }
    }

    /// Moves the links to the poses of these joint positions, at most once per period.
    pub fn pose(&mut self, header: &Header, position_rad: &JointArray) {
        let just_now = |before: i64| header.stamp_ns.abs_diff(before) < POSE_PERIOD_NS;
        if self.posed_ns.is_some_and(just_now) {
            return;
        }
        self.posed_ns = Some(header.stamp_ns);
        self.compute(position_rad);
        for link in &self.links {
            let pose = link_pose(&self.model, &self.data, link.index);
            grow(
                &mut self.bounds,
                position(&self.model, &self.data, link.index),
            );
            let translation = pose.translation.vector.map(|metre| metre as f32);
            let rotation = pose.rotation.coords.map(|part| part as f32);
            self.poses
                .push(header, &link.frame, translation.into(), rotation.into());
        }
        let just_now = |before: i64| header.stamp_ns.abs_diff(before) < COLOUR_PERIOD_NS;
        if !self.coloured_ns.is_some_and(just_now) {
            self.colour(header);
        }
    }

    fn compute(&mut self, position_rad: &JointArray) {
        forward_kinematics(
            &self.model,
            &mut self.data,
            &position_rad[..self.model.dof()],
        );
    }

    /// Sets the permanent colour of all links.
    pub fn paint_all(&mut self, colour: Rgba32) {
        for link in &mut self.links {
            link.colour = colour;
        }
    }

    /// Sets the permanent colour of a link.
    pub fn paint(&mut self, link: &str, colour: Rgba32) {
        if let Some(link) = self.links.iter_mut().find(|drawn| drawn.name == link) {
            link.colour = colour;
        }
    }

    /// Colours the touched link by the detector of a stream.
    pub fn touch(&mut self, header: &Header, stream: usize, link: Option<&str>) {
        let link = link.and_then(|name| self.links.iter().position(|link| link.name == name));
        let before = match link {
            Some(link) => self.touched.insert(stream, link),
            None => self.touched.remove(&stream),
        };
        if before != link {
            self.colour(header);
        }
    }

    fn colour(&mut self, header: &Header) {
        self.coloured_ns = Some(header.stamp_ns);
        for (index, link) in self.links.iter_mut().enumerate() {
            let touched = self.touched.values().any(|&touched| touched == index);
            link.times.push(header);
            link.shown.push(if touched { CONTACT } else { link.colour });
        }
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        for link in self.links.iter_mut().filter(|link| !link.shown.is_empty()) {
            let columns = link
                .shapes
                .colour_columns(&std::mem::take(&mut link.shown))
                .map_err(unserializable(&link.entity))?;
            out(store.columns(&link.entity, link.times.take(), columns.into_iter())?)?;
        }
        self.poses.flush(store, out)
    }
}

/// Name of a link's frame, unique across cells.
fn frame(prefix: &str, link: &str) -> String {
    format!("{prefix}/{link}")
        .trim_start_matches('/')
        .to_owned()
}

fn position(model: &Model, data: &Data, link: usize) -> [f64; 3] {
    link_pose(model, data, link).translation.vector.into()
}

fn grow([low, high]: &mut [[f64; 3]; 2], point: [f64; 3]) {
    for i in 0..3 {
        low[i] = low[i].min(point[i]);
        high[i] = high[i].max(point[i]);
    }
}
