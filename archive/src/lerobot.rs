//! Episodes of LeRobot data sets (<https://github.com/huggingface/lerobot>), versions 2.0 to 3.0.
//!
//! A data set is a folder. Its `meta/info.json` lists the features of a row and the files with the rows. Version 2
//! has a Parquet file for each episode. Version 3 has files with several episodes, which `meta/episodes` lists. An
//! episode is a recording, addressed as `DATASET/episode_000003` whether or not a file has that name. Its rows appear
//! as joint states.
//!
//! Positions, velocities and efforts are recognised by the names of the features and of their elements ([`names`],
//! [`layout`]), or declared in a file next to the data set, `DATASET.columns.yaml` ([`columns`]).

mod columns;
mod cursor;
mod find;
mod info;
mod layout;
mod names;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};
use crate::parquet_file::{ParquetFile, Rows};
use columns::ColumnsFile;
pub(crate) use cursor::EpisodeCursor;
pub(crate) use find::{Place, episodes, files, locate, name, of_table};
use info::Info;
use layout::Layout;

/// The topic that the rows of an episode appear on.
pub(crate) const TOPIC: &str = "/joint_states";
/// Column of the time from the start of the episode \[s\].
const TIMESTAMP: &str = "timestamp";
/// Maximum number of elements of a feature, equal to the limit of [`Rows`].
/// Resolution: bounds memory; a humanoid has some hundreds.
const MOST_ELEMENTS: usize = 1 << 14;
/// Column of the number of the episode.
const EPISODE_INDEX: &str = "episode_index";
/// Farthest plausible position of a revolute joint: two turns \[rad\].
/// Physical: cables limit the turns of a joint; an axis that turns without limit is not a joint of an arm.
const BEYOND: f64 = 4.0 * std::f64::consts::PI;
/// Inverse of the fraction of joints beyond [`BEYOND`] at which positions are classified as degrees.
/// Chosen: one gripper in percent among four or more joints stays below; in degrees, most joints of a motion are
/// beyond.
const SHARE_BEYOND: usize = 3;

/// An episode whose rows have been checked.
#[derive(Debug)]
pub(crate) struct Episode {
    /// The folder of the data set.
    root: PathBuf,
    file: Arc<ParquetFile>,
    layout: Layout,
    fps: Option<f64>,
    first_row: u64,
    pub(crate) rows: u64,
    /// Time of the first and the last row \[ns\].
    pub(crate) times_ns: Option<(i64, i64)>,
    /// Reason why its joint states cannot be compared with expected efforts.
    obstacle: Option<LerobotProblem>,
}

impl Episode {
    /// Opens the episode `number` of the data set in the folder `root` and checks all of its rows, once.
    pub(crate) fn check(root: &Path, number: u64) -> Result<Self, ArchiveError> {
        let info = Info::read(root)?;
        let columns = ColumnsFile::beside(root)?;
        let layout = Layout::of(root, &info, &columns)?;
        let path = find::file_of(root, &info, number)?;
        let mut wanted = vec![TIMESTAMP, EPISODE_INDEX];
        wanted.extend(layout.features.iter().map(String::as_str));
        let file = ParquetFile::open(&path, &wanted)?;
        let (first_row, rows) = rows_of(&file, number)?;
        let mut episode = Self {
            root: root.to_owned(),
            file,
            layout,
            fps: info.fps,
            first_row,
            rows,
            times_ns: None,
            obstacle: None,
        };
        episode.read_through(&columns)?;
        Ok(episode)
    }

    /// Reads all rows to find their time range and whether their positions are in degrees.
    fn read_through(&mut self, columns: &ColumnsFile) -> Result<(), ArchiveError> {
        let mut cursor = self.cursor()?;
        let mut farthest = vec![0.0_f64; self.layout.joints.len()];
        while let Some(time_ns) = cursor.next_state()? {
            let (start_ns, _) = self.times_ns.unwrap_or((time_ns, time_ns));
            self.times_ns = Some((start_ns, time_ns));
            for (most, position) in farthest.iter_mut().zip(&cursor.state().position) {
                *most = most.max(position.abs());
            }
        }
        let beyond = farthest.iter().filter(|most| **most > BEYOND).count();
        let columns_file = ColumnsFile::path(&self.root);
        self.obstacle = if self.layout.effort.is_empty() {
            Some(LerobotProblem::NoEffort {
                features: self.layout.known.clone(),
                columns_file,
            })
        } else if columns.degrees.is_none() && beyond * SHARE_BEYOND >= farthest.len().max(1) {
            Some(LerobotProblem::Degrees {
                most: farthest.iter().fold(0.0, |most: f64, own| most.max(*own)),
                columns_file,
            })
        } else {
            None
        };
        Ok(())
    }

    /// Checks that its joint states can be compared with expected efforts of `joints`.
    pub(crate) fn check_comparable(&self, joints: &[String]) -> Result<(), ArchiveError> {
        let own = &self.layout.joints;
        let missing = joints.iter().filter(|joint| !own.contains(joint));
        let missing: Vec<String> = missing.cloned().collect();
        let unnamed = (!missing.is_empty()).then(|| LerobotProblem::Joints {
            missing,
            own: own.clone(),
            columns_file: ColumnsFile::path(&self.root),
        });
        match self.obstacle.clone().or(unnamed) {
            Some(problem) => Err(LerobotError::new(&self.root, problem).into()),
            None => Ok(()),
        }
    }

    /// Returns the size of its file \[bytes\].
    pub(crate) fn bytes(&self) -> u64 {
        self.file.bytes
    }

    pub(crate) fn cursor(&self) -> Result<EpisodeCursor, ArchiveError> {
        EpisodeCursor::open(self)
    }
}

/// Returns the first row of the episode `number` in a file, and its number of rows.
fn rows_of(file: &Arc<ParquetFile>, number: u64) -> Result<(u64, u64), ArchiveError> {
    if !file.has(EPISODE_INDEX) {
        return Ok((0, file.rows()));
    }
    let wrong = |problem| ArchiveError::from(LerobotError::new(file.path(), problem));
    let mut of_rows = file.column(EPISODE_INDEX, 0)?;
    let mut found: Option<(u64, u64)> = None;
    let mut held = None;
    let mut at = 0;
    while let Some(own) = next_index(&mut of_rows)? {
        if own == number {
            let (first, rows) = found.unwrap_or((at, 0));
            if first + rows != at {
                return Err(wrong(LerobotProblem::Scattered { number }));
            }
            found = Some((first, rows + 1));
        } else if held.is_none() {
            held = Some(own);
        }
        at += 1;
    }
    found.ok_or_else(|| wrong(LerobotProblem::NotInFile { number, held }))
}

/// Returns the next value of a column of indices. A value that is not an index becomes [`u64::MAX`], which nothing
/// has.
fn next_index(rows: &mut Rows) -> Result<Option<u64>, ArchiveError> {
    let mut row = Vec::with_capacity(1);
    if !rows.next_row(&mut row)? {
        return Ok(None);
    }
    let index = row.first().copied().filter(|index| *index >= 0.0);
    Ok(Some(index.map_or(u64::MAX, |index| index as u64)))
}
