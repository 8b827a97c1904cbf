//! Twins behind which detectors are evaluated: built, or fitted on contact-free recordings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use tauscope_bus::flags;
use tauscope_detect::{Impedance, Lesson, Setup};
use tauscope_pipeline::build;
use tauscope_pipeline::calibrate::Job;
use tauscope_pipeline::plausible::{cutoffs_above_half, recorded_rate_hz};
use tauscope_twin::{Expected, JointCorrection, TwinFile};

use crate::error::EvaluateError;
use crate::input::{Request, TwinChoice, TwinSource};
use crate::recording::{Named, Role};
use crate::session::Session;

/// Margin before a contact that is not treated as contact-free \[ns\].
/// Chosen: five times the exactness of labels, `TOLERANCE_S`; a late label must not teach a contact, and more only
/// costs training data.
const BEFORE_NS: i64 = 100_000_000;
/// Margin after a contact that is not treated as contact-free, because arm and filters still respond \[ns\].
/// Chosen: twice the settling time of the twin's low-pass at 4.5 Hz, 0.25 s; more only costs training data.
const AFTER_NS: i64 = 500_000_000;

/// Largest plausible ratio of measured to modelled effort.
/// Tuned: by hand, on no recorded seeds; not swept.
const LARGEST_GAIN: f64 = 5.0;

/// A twin that is ready to run.
#[derive(Debug)]
pub struct Prepared {
    /// Name in tables and folders.
    pub name: String,
    /// Configuration of its stage.
    pub config: tauscope_twin::Config,
    /// Corrections and measured noise.
    pub file: TwinFile,
    /// Wall time of the fit of gains and offsets, including reading \[s\].
    pub fit_s: Option<f64>,
}

impl Prepared {
    /// Builds the twin of `choice`; a regression is fitted on the contact-free part of the train recordings.
    ///
    /// # Errors
    /// If there is nothing to fit on.
    pub fn new(
        request: &Request,
        choice: &TwinChoice,
        progress: &dyn Fn(usize, f64),
    ) -> Result<Self, EvaluateError> {
        let mut config = tauscope_twin::Config::default();
        let reference = match &choice.source {
            TwinSource::Topic => true,
            // The file of a corrected external twin names no robot.
            TwinSource::File(file) => {
                file.robot.name.is_empty() && request.set.topics.twin.is_some()
            }
            TwinSource::Rigid | TwinSource::Regression => false,
        };
        if reference {
            config.expected = Expected::Topic;
        }
        [config.velocity_cutoff_hz, config.effort_cutoff_hz] = request.cutoffs_hz;

        let fit = train(request);
        let topics = request.topics(reference);
        let job = Job {
            cell: &request.cell,
            topics: &topics,
            twin: &config,
            fit: &fit,
            validation: &[],
        };
        let (mut file, mut fit_s) = (job.file(), None);
        match &choice.source {
            TwinSource::File(given) => file = (**given).clone(),
            TwinSource::Rigid => {
                for name in &request.cell.facts.joint_names {
                    file.joints.insert(name.clone(), JointCorrection::default());
                }
            }
            TwinSource::Regression | TwinSource::Topic => {
                if fit.is_empty() {
                    return Err(EvaluateError::NothingToFit {
                        twin: choice.name.clone(),
                    });
                }
                let began = Instant::now();
                let is_free = |path: &Path, stamp_ns: i64| {
                    let recording = request.recordings.iter().find(|r| r.path == path);
                    recording.is_none_or(|recording| is_free(recording, stamp_ns))
                };
                file = job.fit(&is_free, progress)?.file;
                fit_s = Some(began.elapsed().as_secs_f64());
            }
        }
        Ok(Self {
            name: choice.name.clone(),
            config,
            file,
            fit_s,
        })
    }

    /// Starts a session of the set's recordings behind this twin.
    ///
    /// # Errors
    /// If it does not fit the robot.
    pub fn session<'a>(&self, request: &'a Request) -> Result<Session<'a>, EvaluateError> {
        let reference = self.config.expected == Expected::Topic;
        let twin = build::twin(&self.config, Some(&self.file), &request.cell)?;
        Ok(Session::new(&request.cell, request.topics(reference), twin))
    }

    /// Measures the noise of the residual on the contact-free part of `lessons`: the root mean square about zero,
    /// because a constant error of the twin is noise to a detector, too.
    ///
    /// # Errors
    /// If there is no such part.
    pub fn measure(&mut self, request: &Request, lessons: &[Lesson]) -> Result<(), EvaluateError> {
        let names = &request.cell.facts.joint_names;
        let (mut squares, mut count) = (vec![0.0; names.len()], 0_u64);
        for lesson in lessons {
            for sample in &lesson.samples {
                let stamp_ns = sample.header.stamp_ns;
                if sample.header.has(flags::READY) && is_free_of(lesson, stamp_ns) {
                    count += 1;
                    for (sum, residual) in squares.iter_mut().zip(sample.residual) {
                        *sum += residual * residual;
                    }
                }
            }
        }
        if count == 0 {
            return Err(EvaluateError::NothingFree);
        }
        for (name, sum) in names.iter().zip(squares) {
            let joint = self.file.joints.entry(name.clone()).or_default();
            joint.noise = Some((sum / count as f64).sqrt());
        }
        self.file.scores.clear();
        Ok(())
    }

    /// Notes implausible fitted gains.
    pub fn doubts(&self) -> Option<String> {
        self.fit_s?;
        let said: Vec<String> = (self.file.joints.iter())
            .filter(|(_, joint)| !(0.0..=LARGEST_GAIN).contains(&joint.gain))
            .map(|(name, joint)| format!("{:.2} at {name}", joint.gain))
            .collect();
        (!said.is_empty()).then(|| {
            format!(
                "{}: the fitted gain is {}: effort that the model leaves out, such as friction, is larger there than the modelled effort",
                self.name,
                said.join(", ")
            )
        })
    }

    /// Notes the first recording whose rate is so low that a low-pass of the twin has no effect.
    pub fn passing_all(&self, request: &Request) -> Option<String> {
        let filters = self.config.filters(Some(self.file.filters));
        let topics = request.topics(false);
        request.recordings.iter().find_map(|named| {
            // An unreadable recording was reported when the set was loaded.
            let recording = tauscope_session::open(&named.path).ok()?;
            let rate_hz = recorded_rate_hz(&recording, &topics.state).ok()??;
            let fault = cutoffs_above_half(filters, rate_hz).next()?;
            Some(format!("{}: {fault}", named.name))
        })
    }

    /// Properties of cell and twin that a detector needs.
    ///
    /// # Errors
    /// If it does not fit the robot.
    pub fn setup(&self, request: &Request) -> Result<Setup, EvaluateError> {
        let (set, model) = (&request.set, request.cell.model.as_ref());
        let link = (set.tool_link.as_ref()).and_then(|link| model?.link_index(link));
        let impedance = set.impedance.as_ref().map(|impedance| Impedance {
            translational_n_per_m: impedance.translational_n_per_m,
            rotational_nm_per_rad: impedance.rotational_nm_per_rad,
        });
        Ok(Setup {
            tool_link: link,
            contact_point_on_tool_m: set.contact_point_on_tool_m,
            impedance,
            ..build::detect_setup(Some(&self.file), &request.cell)?
        })
    }
}

fn train(request: &Request) -> Vec<PathBuf> {
    let train = (request.recordings.iter()).filter(|recording| recording.role == Role::Train);
    train.map(|recording| recording.path.clone()).collect()
}

/// Whether this instant is contact-free by the labels, including the margins before and after a contact. Without
/// labels every instant is.
pub fn is_free(recording: &Named, stamp_ns: i64) -> bool {
    let events = recording.truth.iter().flat_map(|truth| &truth.events);
    let mut spans = events.map(|event| event.labelled(recording.start_ns));
    !spans.any(|contact| touches(contact.on_ns, contact.off_ns, stamp_ns))
}

/// Whether this instant of a lesson is contact-free, as in [`is_free`].
pub fn is_free_of(lesson: &Lesson, stamp_ns: i64) -> bool {
    let mut contacts = lesson.contacts.iter().flatten();
    !contacts.any(|contact| touches(contact.on_ns, contact.off_ns, stamp_ns))
}

fn touches(on_ns: i64, off_ns: i64, stamp_ns: i64) -> bool {
    (on_ns - BEFORE_NS..=off_ns + AFTER_NS).contains(&stamp_ns)
}
