//! Frame of the kinds of stages: what a kind tells about itself, and the types that hold a stage of any kind.

pub mod check;
pub mod entry;
pub mod role;
pub mod site;

use std::any::Any;
use std::fmt::Debug;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde::{Serialize, Serializer};
use tauscope_bus::shell::Node;
use tauscope_bus::{Keep, SampleKind, Wake};

use check::{Check, Spot};
use role::{Placement, Role, Takes};
use site::{LiveSite, NodeError, ReplaySite};

/// A kind of stage, as the part of the pipeline file under its key. Every kind implements this in its file, and the
/// [table](super::stages::STAGES) of stages names the type.
pub trait StageConfig:
    Clone + Debug + DeserializeOwned + JsonSchema + Send + Sync + 'static
{
    /// The settings of the stage: this part of the file, with paths resolved and the files read that it names.
    type Settings: StageSettings;

    /// Key in the file.
    const KEY: &'static str;
    /// Description for the schema of the pipeline file.
    const ABOUT: &'static str;
    /// Former key, which is still accepted.
    const FORMER_KEY: Option<&'static str> = None;
    /// Default process of the stage.
    const PLACEMENT: Placement = Placement::WithCell;
    /// Default overflow policy of the stage's inputs.
    const KEEP: Keep = Keep::All;
    /// Whether the stage also receives the health reports of its input stages.
    const HEARS_HEALTH: bool = false;
    /// Whether a detection of the stage is a contact.
    const JUDGES_CONTACT: bool = false;

    /// Permitted inputs.
    fn takes(&self) -> Takes;

    /// Type of the output samples, if there is an output.
    fn gives(&self) -> Option<SampleKind>;

    /// Resolves and checks this part of the file at `spot`; problems go to the report of `check`. `None` if it is
    /// invalid.
    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<Self::Settings>;
}

/// Settings of a stage, from which its node is created.
pub trait StageSettings:
    Clone + Debug + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Creates the node of a stage in a running pipeline.
    ///
    /// # Errors
    /// If the stage cannot be created from its settings.
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError>;

    /// Creates the node of the stage in a replay; `None` if a replay leaves the stage out.
    ///
    /// # Errors
    /// If the stage cannot be created from its settings.
    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError>;

    /// Default wake-up on a new sample.
    fn wake(&self) -> Wake {
        Wake::Event
    }

    /// Name of the detector behind the stage's detections.
    fn detector(&self) -> Option<&str> {
        None
    }

    /// Whether the stage learns anew on request.
    fn learns_when_told(&self) -> bool {
        false
    }
}

/// Entry of the table of stages; see [`StageConfig`].
#[derive(Debug)]
pub struct Kind {
    /// Key in the file.
    pub key: &'static str,
    /// Former key, which is still accepted.
    pub former_key: Option<&'static str>,
    /// Description for the schema of the pipeline file.
    pub about: &'static str,
    /// Default process.
    pub placement: Placement,
    /// Default overflow policy of the inputs.
    pub keep: Keep,
    /// Whether it receives the health reports of its input stages.
    pub hears_health: bool,
    /// Whether its detections are contacts.
    pub judges_contact: bool,
    /// Reads its part of a pipeline file.
    pub(super) read: Read,
    /// Schema of that part.
    pub(super) schema: fn(&mut SchemaGenerator) -> Schema,
    /// Reads its settings as they were serialised.
    pub(super) settings: fn(serde_json::Value) -> Result<Settings, serde_json::Error>,
}

/// Reads a part of a pipeline file of any format; `None` for a null.
type Read = fn(
    &mut dyn erased_serde::Deserializer<'_>,
) -> Result<Option<Box<dyn AnyConfig>>, erased_serde::Error>;

impl Kind {
    /// Returns the entry of the kind with this part of the pipeline file.
    pub(super) const fn of<C: StageConfig>() -> Self {
        Self {
            key: C::KEY,
            former_key: C::FORMER_KEY,
            about: C::ABOUT,
            placement: C::PLACEMENT,
            keep: C::KEEP,
            hears_health: C::HEARS_HEALTH,
            judges_contact: C::JUDGES_CONTACT,
            read: |file| {
                let config = erased_serde::deserialize::<Option<C>>(file)?;
                Ok(config.map(|config| Box::new(config) as Box<dyn AnyConfig>))
            },
            schema: |generator| generator.subschema_for::<Option<C>>(),
            settings: |value| {
                let settings: C::Settings = serde_json::from_value(value)?;
                Ok(Settings::of::<C>(settings))
            },
        }
    }

    /// Whether this is the kind with this part of the pipeline file.
    pub fn is<C: StageConfig>(&self) -> bool {
        self.key == C::KEY
    }
}

/// [`StageConfig`] of any kind.
pub trait AnyConfig: Any + Debug + Send + Sync {
    /// Kind of the stage, with its sample types.
    fn role(&self) -> Role;
    /// [`StageConfig::check`].
    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<Settings>;
    /// Returns a copy.
    fn boxed(&self) -> Box<dyn AnyConfig>;
}

impl<C: StageConfig> AnyConfig for C {
    fn role(&self) -> Role {
        Role {
            kind: const { &Kind::of::<C>() },
            takes: self.takes(),
            gives: self.gives(),
        }
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<Settings> {
        StageConfig::check(self, check, spot).map(Settings::of::<C>)
    }

    fn boxed(&self) -> Box<dyn AnyConfig> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn AnyConfig> {
    fn clone(&self) -> Self {
        (**self).boxed()
    }
}

/// [`StageSettings`] of any kind.
trait AnySettings: Any + Debug + Send + Sync + erased_serde::Serialize {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError>;
    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError>;
    fn wake(&self) -> Wake;
    fn detector(&self) -> Option<&str>;
    fn learns_when_told(&self) -> bool;
    fn boxed(&self) -> Box<dyn AnySettings>;
}

impl<S: StageSettings> AnySettings for S {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        StageSettings::live(self, site)
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        StageSettings::replayed(self, site)
    }

    fn wake(&self) -> Wake {
        StageSettings::wake(self)
    }

    fn detector(&self) -> Option<&str> {
        StageSettings::detector(self)
    }

    fn learns_when_told(&self) -> bool {
        StageSettings::learns_when_told(self)
    }

    fn boxed(&self) -> Box<dyn AnySettings> {
        Box::new(self.clone())
    }
}

erased_serde::serialize_trait_object!(AnySettings);

/// Settings of a stage of any kind.
#[derive(Debug)]
pub struct Settings {
    key: &'static str,
    settings: Box<dyn AnySettings>,
}

impl Settings {
    fn of<C: StageConfig>(settings: C::Settings) -> Self {
        Self {
            key: C::KEY,
            settings: Box::new(settings),
        }
    }

    /// The settings, if their type is `S`.
    pub fn get<S: StageSettings>(&self) -> Option<&S> {
        (&*self.settings as &dyn Any).downcast_ref()
    }

    /// The settings to be changed, if their type is `S`.
    pub fn get_mut<S: StageSettings>(&mut self) -> Option<&mut S> {
        (&mut *self.settings as &mut dyn Any).downcast_mut()
    }

    /// [`StageSettings::live`].
    ///
    /// # Errors
    /// As there.
    pub fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        self.settings.live(site)
    }

    /// [`StageSettings::replayed`].
    ///
    /// # Errors
    /// As there.
    pub fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        self.settings.replayed(site)
    }

    /// [`StageSettings::wake`].
    pub fn wake(&self) -> Wake {
        self.settings.wake()
    }

    /// [`StageSettings::detector`].
    pub fn detector(&self) -> Option<&str> {
        self.settings.detector()
    }

    /// [`StageSettings::learns_when_told`].
    pub fn learns_when_told(&self) -> bool {
        self.settings.learns_when_told()
    }
}

impl Clone for Settings {
    fn clone(&self) -> Self {
        Self {
            key: self.key,
            settings: self.settings.boxed(),
        }
    }
}

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.key, &self.settings).serialize(serializer)
    }
}
