//! Sources of samples: recordings, live ROS 2 over Zenoh, Universal Robots controllers, the simulated
//! cell.
//!
//! The messages of all sources go through the same packing. It brings the joints into the cell's order
//! by name, and attaches to each sample the command, tool and external effort of its instant. Packing is
//! pure; the sources do the input, and [`Paced`] delays recorded and simulated samples until they are due.
//!
//! The simulated cell needs no robot:
//!
//! ```
//! use tauscope_dynamics::Model;
//! use tauscope_ingest::simulated::{Scenario, Simulation};
//!
//! let pendulum = r#"<robot name="pendulum">
//!   <link name="base"/>
//!   <link name="rod"><inertial>
//!     <origin xyz="0 0 -0.5"/><mass value="2"/>
//!     <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
//!   </inertial></link>
//!   <joint name="hinge" type="revolute">
//!     <parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
//!     <limit lower="-2" upper="2" velocity="2" effort="50"/>
//!   </joint>
//! </robot>"#;
//! let scenario: Scenario = serde_json::from_str(
//!     r#"{"version": 1, "robot": "pendulum.urdf", "seed": 1, "rate_hz": 100,
//!         "physics": [{"effect": "coulomb_friction", "joint": "hinge", "parameters": {"coulomb_nm": 1.5}}],
//!         "recordings": [{"name": "swing", "duration_s": 2, "motion": {"fourier": {"period_s": 2}}}]}"#,
//! )?;
//! let mut simulation = Simulation::new(&scenario, &Model::from_urdf(pendulum)?, 0)?;
//! let mut readings = 0;
//! while let Some(reading) = simulation.next_reading()? {
//!     assert!(reading.effort[0].is_finite());
//!     readings += 1;
//! }
//! assert_eq!(readings, 201);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod ahead;
mod archived_twin;
mod commanded;
mod config;
mod error;
mod findings;
mod pacing;
mod pack;
mod queue;
mod recorded;
mod setup;
pub mod simulated;
mod sources;
mod tcp;
mod ur_rtde;
mod zenoh;

pub use ahead::Ahead;
pub use archived_twin::{ArchivedTwin, ArchivedTwinTopics};
pub use commanded::{Commanded, Takes};
pub use config::{
    Config, ConfigError, CsvConfig, FileConfig, Keys, Rate, SimulateConfig, Topics, UrEffort,
    UrRtdeConfig, ZenohConfig,
};
pub use error::IngestError;
pub use findings::Findings;
pub use pacing::Paced;
pub use recorded::RecordedSource;
pub use setup::{Setup, Tool};
pub use sources::{Entry, Opening, SOURCES, SimulatedRobot, SourceSettings, open};
pub use ur_rtde::UrRtdeSource;
pub use zenoh::{ZenohCounts, ZenohSource};
