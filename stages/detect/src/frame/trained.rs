//! The file of a trained detector: safetensors, so that numpy and `PyTorch` can read the weights, too.
//! Everything that is not an array is JSON in its header under `tauscope`.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Current version of the format.
const VERSION: u32 = 1;
/// The header's key for [`Facts`].
const KEY: &str = "tauscope";
/// Mean and standard deviation of the score on contact-free data.
const SCORE: &str = "score";

/// A trained detector: weights, scaling, and facts about its training.
#[derive(Debug, Clone, PartialEq)]
pub struct Trained {
    facts: Facts,
    arrays: BTreeMap<String, Array>,
}

/// Facts about a trained detector in addition to its arrays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Facts {
    /// Version of this format: 1.
    pub version: u32,
    /// The detector's canonical name.
    pub detector: String,
    /// The joints it was trained for, in URDF order.
    pub joints: Vec<String>,
    /// Samples per second of the training data.
    pub rate_hz: f64,
    /// Number of training samples.
    pub samples: u64,
    /// Seed of the random numbers in the training.
    pub seed: u64,
    /// Settings of its input signals.
    pub signals: SignalSettings,
    /// Number of samples behind one score.
    pub window: usize,
    /// Origin of this file: program version, recordings and their hashes.
    pub provenance: BTreeMap<String, String>,
}

/// Input signals of a learned detector. They belong to its training: a trained detector uses the settings with
/// which it was trained.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SignalSettings {
    /// Gain of the momentum observer \[1/s\].
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub observer_gain_per_s: f64,
    /// Low-pass on external torques, positions and velocities \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub cutoff_hz: f64,
}

impl Default for SignalSettings {
    fn default() -> Self {
        Self {
            observer_gain_per_s: super::momentum::gain::DEFAULT_GAIN_PER_S,
            // About the twin's cutoff on efforts; the paper does not state its cutoff.
            cutoff_hz: 4.0,
        }
    }
}

impl SignalSettings {
    /// Returns the first invalid setting, if any, as a message.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !positive(self.observer_gain_per_s) {
            return Some("`observer_gain_per_s` must be above 0");
        }
        (!positive(self.cutoff_hz)).then_some("`cutoff_hz` must be above 0")
    }
}

/// A detector's score on contact-free data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreStatistics {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub standard_deviation: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Array {
    shape: Vec<usize>,
    dtype: Dtype,
    /// Little-endian.
    bytes: Vec<u8>,
}

/// Error in the file of a trained detector.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TrainedError {
    /// A file that is not in safetensors format.
    #[error("not the file of a trained detector: {reason}")]
    Format {
        /// The reader's error message.
        reason: String,
    },
    /// A safetensors file without a trained detector.
    #[error(
        "not the file of a trained detector: its header has no readable `tauscope` entry ({reason})"
    )]
    Facts {
        /// The error in the header's entry.
        reason: String,
    },
    /// An unsupported version of the format.
    #[error("a trained detector of format version {found}; this program reads version {VERSION}")]
    Version {
        /// The file's version.
        found: u32,
    },
    /// A required array that is missing or has another shape or type.
    #[error("the trained detector's `{name}` should be {wanted}, and is {found}")]
    Array {
        /// Name of the array.
        name: String,
        /// Required shape and type.
        wanted: String,
        /// Shape and type in the file.
        found: String,
    },
}

impl Trained {
    /// Creates a trained detector without arrays.
    pub(crate) fn new(facts: Facts) -> Self {
        Self {
            facts: Facts {
                version: VERSION,
                ..facts
            },
            arrays: BTreeMap::new(),
        }
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// If they are not a valid trained detector.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TrainedError> {
        let format = |error: safetensors::SafeTensorError| TrainedError::Format {
            reason: error.to_string(),
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(format)?;
        let text = (header.metadata().as_ref())
            .and_then(|entries| entries.get(KEY))
            .ok_or_else(|| TrainedError::Facts {
                reason: "there is none".to_owned(),
            })?;
        let facts = |error: serde_json::Error| TrainedError::Facts {
            reason: error.to_string(),
        };
        let version: Version = serde_json::from_str(text).map_err(facts)?;
        if version.version != VERSION {
            let found = version.version;
            return Err(TrainedError::Version { found });
        }
        let facts: Facts = serde_json::from_str(text).map_err(facts)?;
        let empty = (facts.window == 0).then_some("`window` must be at least 1");
        if let Some(fault) = facts.signals.fault().or(empty) {
            let reason = fault.to_owned();
            return Err(TrainedError::Facts { reason });
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(format)?;
        let arrays = (tensors.iter())
            .map(|(name, view)| {
                let array = Array {
                    shape: view.shape().to_vec(),
                    dtype: view.dtype(),
                    bytes: view.data().to_vec(),
                };
                (name.to_owned(), array)
            })
            .collect();
        let trained = Self { facts, arrays };
        trained.get_f64(SCORE, &[2])?;
        Ok(trained)
    }

    /// Returns the bytes of its file; equal detectors give equal bytes.
    ///
    /// # Errors
    /// If the header would be longer than the format allows.
    pub fn to_bytes(&self) -> Result<Vec<u8>, TrainedError> {
        let format = |reason: String| TrainedError::Format { reason };
        let text = serde_json::to_string(&self.facts).map_err(|error| format(error.to_string()))?;
        let views = (self.arrays.iter())
            .map(|(name, array)| {
                let view = TensorView::new(array.dtype, array.shape.clone(), &array.bytes);
                view.map(|view| (name.as_str(), view))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| format(error.to_string()))?;
        let header = HashMap::from([(KEY.to_owned(), text)]);
        safetensors::serialize(views, Some(header)).map_err(|error| format(error.to_string()))
    }

    /// Returns the facts about its training.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Returns its origin, to be filled in by the program.
    pub fn provenance_mut(&mut self) -> &mut BTreeMap<String, String> {
        &mut self.facts.provenance
    }

    /// Returns the statistics of its score on contact-free data, from which its threshold follows.
    pub fn score(&self) -> ScoreStatistics {
        let score = self.get_f64(SCORE, &[2]).unwrap_or(vec![f64::NAN; 2]);
        ScoreStatistics {
            mean: score[0],
            standard_deviation: score[1],
        }
    }

    pub(crate) fn set_score(&mut self, score: ScoreStatistics) {
        self.put_f64(SCORE, &[2], &[score.mean, score.standard_deviation]);
    }

    pub(crate) fn put_f64(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.put(name, shape, Dtype::F64, bytes);
    }

    pub(crate) fn put_f32(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.put(name, shape, Dtype::F32, bytes);
    }

    fn put(&mut self, name: &str, shape: &[usize], dtype: Dtype, bytes: Vec<u8>) {
        let array = Array {
            shape: shape.to_vec(),
            dtype,
            bytes,
        };
        self.arrays.insert(name.to_owned(), array);
    }

    pub(crate) fn get_f64(&self, name: &str, shape: &[usize]) -> Result<Vec<f64>, TrainedError> {
        let (chunks, _) = self.get(name, shape, Dtype::F64)?.as_chunks::<8>();
        Ok(chunks.iter().map(|b| f64::from_le_bytes(*b)).collect())
    }

    pub(crate) fn get_f32(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, TrainedError> {
        let (chunks, _) = self.get(name, shape, Dtype::F32)?.as_chunks::<4>();
        Ok(chunks.iter().map(|b| f32::from_le_bytes(*b)).collect())
    }

    fn get(&self, name: &str, shape: &[usize], dtype: Dtype) -> Result<&[u8], TrainedError> {
        let array = self.arrays.get(name);
        if let Some(array) = array.filter(|array| array.shape == shape && array.dtype == dtype) {
            return Ok(&array.bytes);
        }
        Err(TrainedError::Array {
            name: name.to_owned(),
            wanted: format!("{shape:?} of {dtype}"),
            found: array.map_or("not there".to_owned(), |array| {
                format!("{:?} of {}", array.shape, array.dtype)
            }),
        })
    }

    /// Returns the shape of an array; empty if the array is missing.
    pub(crate) fn shape(&self, name: &str) -> &[usize] {
        self.arrays.get(name).map_or(&[], |array| &array.shape)
    }
}

/// The version alone, read first, so that another version is reported as such.
#[derive(Deserialize)]
struct Version {
    version: u32,
}
