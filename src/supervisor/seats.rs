//! Assignments of the stages to their processes: one seat per stage.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use tauscope_bus::link::SpillSettings;
use tauscope_bus::seat::{Cell as SeatCell, Input, Output, OutputLink, TransportKind};
use tauscope_bus::{Audience, Domain, Keep, SampleKind, Seat, Wake, ZenohEndpoints};
use tauscope_pipeline::cell::CellFacts;
use tauscope_pipeline::pipeline::stages::ingest::IngestSettings;
use tauscope_pipeline::pipeline::stages::outside::OutsideEntry;
use tauscope_pipeline::pipeline::{Pipeline, Placement, Settings, StreamFacts};

use crate::plan::{Link, Over};

/// Queue length of an input that keeps all samples; the sender waits while it is full.
const DEPTH_ALL: usize = 1024;
/// Queue length of an input that keeps the newest samples: long enough that a pause of the scheduler loses nothing.
const DEPTH_NEWEST: usize = 16;
/// Queue length of such an input of a recorder or publisher, or from another host, where samples arrive in bursts: a
/// longer pause loses nothing either.
const DEPTH_TOLD: usize = 256;
/// Largest backlog for slow receivers, by stream \[bytes\]: 17 s of joint states at 1 kHz.
/// Resolution: memory, against the longest pause of a recorder without loss.
const SPILL_BYTES: usize = 16 << 20;
/// Largest backlog for receivers on other hosts, by stream \[bytes\]: 60 s of twin states at 1 kHz.
/// Resolution: memory, against the longest network outage without loss.
const SPILL_ACROSS_HOSTS_BYTES: usize = 64 << 20;
/// Batching interval of samples for recorders and publishers \[ms\].
/// Resolution: wake-ups of a process, against the delay of a recording.
const SPILL_LINGER_MS: u64 = 5;
/// Extra receivers per stream, for those that died and are not cleaned up yet.
/// Resolution: shared memory.
const LIVES: usize = 2;
/// Longest wait for stages of other hosts, which are started independently \[ms\].
const START_ACROSS_HOSTS_MS: u64 = 60_000;

/// Content of `config` in the seat of a built-in stage.
#[derive(Debug, Serialize, Deserialize)]
pub struct Instructions {
    /// Its own part of the pipeline file.
    pub settings: Settings,
    /// Its cells.
    pub cells: Vec<CellFacts>,
    /// Its input streams, for a recorder or a publisher.
    pub streams: Vec<StreamFacts>,
    /// Provenance of the archive, for a recorder or a publisher.
    pub provenance: BTreeMap<String, String>,
    /// Stamp of the last emitted sample, for a source that is restarted \[ns\].
    #[serde(default)]
    pub after_ns: Option<i64>,
    /// Whether any stage of its cell learns on command, for a source.
    #[serde(default)]
    pub somebody_learns: bool,
}

/// Returns the seats of the stages on `host` (all stages if `None`), with their index in the pipeline. `router` is
/// the endpoint for links to other hosts.
pub fn seats(
    pipeline: &Pipeline,
    links: &[Link],
    host: Option<&str>,
    domain: &Domain,
    router: Option<&str>,
) -> Result<Vec<(usize, Seat)>, serde_json::Error> {
    let planner = Planner {
        pipeline,
        links,
        domain,
        router,
    };
    let here = |index: &usize| host.is_none() || pipeline.stages[*index].host.as_deref() == host;
    (0..pipeline.stages.len())
        .filter(here)
        .map(|at| Ok((at, planner.seat(at)?)))
        .collect()
}

struct Planner<'a> {
    pipeline: &'a Pipeline,
    links: &'a [Link],
    domain: &'a Domain,
    /// Endpoint for links to other hosts.
    router: Option<&'a str>,
}

impl Planner<'_> {
    fn seat(&self, at: usize) -> Result<Seat, serde_json::Error> {
        let stage = &self.pipeline.stages[at];
        let mut seat = Seat::new(&stage.name, self.domain.clone());
        seat.receivers = self.receivers();
        seat.cells = stage
            .cells
            .iter()
            .filter_map(|cell| self.cell(cell))
            .collect();
        seat.inputs = self.inputs(at);
        seat.output = stage.role.gives.map(|kind| self.output(at, kind));
        seat.health = Some(self.health(at));
        let outputs = seat
            .output
            .iter()
            .chain(&seat.health)
            .flat_map(|output| &output.links);
        let crosses = outputs.map(|link| link.transport);
        let crosses = crosses.chain(seat.inputs.iter().map(|input| input.transport));
        if crosses
            .into_iter()
            .any(|transport| transport == TransportKind::Zenoh)
        {
            let connect = self
                .router
                .iter()
                .map(|&endpoint| endpoint.to_owned())
                .collect();
            seat.zenoh = Some(ZenohEndpoints {
                listen: Vec::new(),
                connect,
            });
            seat.start_within_ms = START_ACROSS_HOSTS_MS;
        }
        seat.config = match stage.settings.get::<OutsideEntry>() {
            Some(outside) => outside.settings.clone().unwrap_or_default(),
            None => serde_json::to_value(self.instructions(at))?,
        };
        Ok(seat)
    }

    /// Returns the largest number of receivers of one stream in shared memory, plus [`LIVES`].
    fn receivers(&self) -> usize {
        let shared = |link: &&Link| link.over == Over::SharedMemory;
        let mut count = BTreeMap::<(usize, bool), usize>::new();
        for link in self.links.iter().filter(shared) {
            *count
                .entry((link.from, link.keep == Keep::All))
                .or_default() += 1;
        }
        count.into_values().max().unwrap_or(0) + LIVES
    }

    fn instructions(&self, at: usize) -> Instructions {
        let stage = &self.pipeline.stages[at];
        let cells = stage
            .cells
            .iter()
            .filter_map(|cell| self.pipeline.cells.get(cell));
        let (streams, provenance) = if stage.role.kind.hears_health {
            (
                self.pipeline.streams(&stage.inputs),
                self.pipeline.provenance(),
            )
        } else {
            Default::default()
        };
        Instructions {
            settings: stage.settings.clone(),
            cells: cells.map(|cell| cell.facts.clone()).collect(),
            streams,
            provenance,
            after_ns: None,
            somebody_learns: self.learns(&stage.cells),
        }
    }

    /// Returns whether any stage in these cells may learn on command; an external program may.
    fn learns(&self, cells: &BTreeSet<String>) -> bool {
        let stages = self.pipeline.stages.iter();
        let mut there = stages.filter(|stage| stage.cells.iter().any(|cell| cells.contains(cell)));
        there.any(|stage| stage.settings.learns_when_told())
    }

    fn cell(&self, name: &str) -> Option<SeatCell> {
        let facts = &self.pipeline.cells.get(name)?.facts;
        Some(SeatCell {
            name: facts.name.clone(),
            joints: facts.joint_names.clone(),
            effort_unit: facts.effort_unit,
        })
    }

    fn inputs(&self, at: usize) -> Vec<Input> {
        let mut inputs = Vec::new();
        for link in self.links.iter().filter(|link| link.to == at) {
            let wake = self.pipeline.stages[at].wake;
            let input = |stream: String, kind, wake| Input {
                from: self.pipeline.stages[link.from].name.clone(),
                stream,
                kind,
                transport: transport(link.over),
                keep: link.keep,
                depth: match link.keep {
                    Keep::All => DEPTH_ALL,
                    Keep::Newest if self.hears_health(at) || link.over == Over::Zenoh => DEPTH_TOLD,
                    Keep::Newest => DEPTH_NEWEST,
                },
                wake,
                resume: None,
            };
            inputs.push(input(link.stream.clone(), link.carries, wake));
            if self.hears_health(at) {
                // Health reports are rare: polling would cost more than it saves.
                inputs.push(input(
                    health_stream(&link.stream),
                    SampleKind::Health,
                    Wake::Event,
                ));
            }
        }
        inputs
    }

    /// Returns whether a stage receives health reports: a recorder stores them, a publisher publishes them.
    fn hears_health(&self, at: usize) -> bool {
        self.pipeline.stages[at].role.kind.hears_health
    }

    fn output(&self, at: usize, kind: SampleKind) -> Output {
        let listeners: Vec<&Link> = self.links.iter().filter(|link| link.from == at).collect();
        Output {
            stream: self.pipeline.stages[at].stream(),
            kind,
            former: 0,
            links: self.ways(at, kind, &listeners),
        }
    }

    fn health(&self, at: usize) -> Output {
        let listeners = self.links.iter().filter(|link| link.from == at);
        let listeners: Vec<&Link> = listeners
            .filter(|link| self.hears_health(link.to))
            .collect();
        Output {
            stream: health_stream(&self.pipeline.stages[at].stream()),
            kind: SampleKind::Health,
            former: 0,
            links: self.ways(at, SampleKind::Health, &listeners),
        }
    }

    /// Returns the links by which a stream leaves its group, with the number of receivers of each.
    fn ways(&self, at: usize, kind: SampleKind, listeners: &[&Link]) -> Vec<OutputLink> {
        let way = |over: Over| {
            let there = || listeners.iter().filter(|link| link.over == over);
            let count = |keep| there().filter(|link| link.keep == keep).count();
            let audience = Audience {
                keep_all: count(Keep::All),
                keep_newest: count(Keep::Newest),
            };
            let takes = |link: &&Link| self.pipeline.stages[link.to].role.gives.is_none();
            let all_take = there().all(takes);
            // Health reports are rare: the link itself has room for those of a quarter of an hour.
            let may_block = match over {
                Over::InProcess => return None,
                Over::SharedMemory => audience.keep_all > 0 && kind != SampleKind::Health,
                Over::Zenoh => true,
            };
            let placement = self.pipeline.stages[at].role.kind.placement;
            let ours = placement != Placement::Program;
            let spill = (may_block && ours).then(|| SpillSettings {
                bytes: match over {
                    Over::Zenoh => SPILL_ACROSS_HOSTS_BYTES,
                    Over::InProcess | Over::SharedMemory => SPILL_BYTES,
                },
                linger_ms: match over {
                    Over::Zenoh => self.gather_ms(at),
                    _ if all_take => SPILL_LINGER_MS,
                    _ => 0,
                },
                waits: self.source_can_wait(at),
            });
            (audience != Audience::default()).then_some(OutputLink {
                transport: transport(over),
                audience,
                spill,
            })
        };
        [Over::SharedMemory, Over::Zenoh]
            .into_iter()
            .filter_map(way)
            .collect()
    }

    /// Returns the batching interval of samples of this stage for other hosts \[ms\].
    fn gather_ms(&self, at: usize) -> u64 {
        let host = self.pipeline.stages[at].host.as_ref();
        let host = host.and_then(|host| self.pipeline.hosts.get(host));
        host.map_or(0, |host| host.gather_ms)
    }

    /// Returns whether the source of this stage's samples can wait without loss, because it reads a file. An external
    /// program is assumed to be able to wait.
    fn source_can_wait(&self, at: usize) -> bool {
        let stage = &self.pipeline.stages[at];
        match (stage.settings.get::<IngestSettings>(), stage.inputs.first()) {
            (Some(source), _) => source.reads_file(),
            (None, Some(&input)) => self.source_can_wait(input),
            (None, None) => true,
        }
    }
}

fn health_stream(stream: &str) -> String {
    format!("{stream}/health")
}

fn transport(over: Over) -> TransportKind {
    match over {
        Over::InProcess => TransportKind::InProcess,
        Over::SharedMemory => TransportKind::Iceoryx2,
        Over::Zenoh => TransportKind::Zenoh,
    }
}
