//! What detectors of one stream derive alike, derived once.

use std::sync::{Arc, Mutex, PoisonError};

use crate::frame::momentum::Inertia;
use crate::indri::virtual_collision_sensor::{BlockSettings, Blocks};
use crate::salt_ducaju::contact_signals::{SignalSettings, Signals};

/// Handed to detectors by [`Setup::shared`](crate::Setup::shared), it lets them take from one another what they derive alike: the
/// arm's inertia in motion, and where the settings are the same the signals after Salt Ducaju et al. and what the currents do after Indri et al.
///
/// Only detectors that are given the very same samples one after the other may share, such as the
/// detectors behind one twin in a replay: whoever sees a sample first derives, the others find it done.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<Mutex<Derived>>);

#[derive(Debug, Default)]
struct Derived {
    inertia: Option<Arc<Mutex<Inertia>>>,
    signals: Vec<(SignalSettings, Arc<Mutex<Signals>>)>,
    blocks: Vec<(BlockSettings, Arc<Mutex<Blocks>>)>,
}

impl Shared {
    /// The inertia that is shared; `new` where nobody has asked yet.
    pub(crate) fn inertia(&self, new: impl FnOnce() -> Inertia) -> Tap<Inertia> {
        let mut derived = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let inertia = derived.inertia.get_or_insert_with(|| shared(new()));
        Tap::Shared(Arc::clone(inertia))
    }

    /// The signals that are shared under these settings; `own` where nobody has asked yet.
    pub(crate) fn signals(&self, settings: &SignalSettings, own: Signals) -> Tap<Signals> {
        let mut derived = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        under(&mut derived.signals, *settings, own)
    }

    /// What the joints' currents do under these settings; `own` where nobody has asked yet.
    pub(crate) fn blocks(&self, settings: BlockSettings, own: Blocks) -> Tap<Blocks> {
        let mut derived = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        under(&mut derived.blocks, settings, own)
    }
}

/// What `all` has under these settings, or else `own` from now on.
fn under<S: PartialEq, T>(all: &mut Vec<(S, Arc<Mutex<T>>)>, settings: S, own: T) -> Tap<T> {
    if let Some((_, value)) = all.iter().find(|(of, _)| *of == settings) {
        return Tap::Shared(Arc::clone(value));
    }
    let own = shared(own);
    all.push((settings, Arc::clone(&own)));
    Tap::Shared(own)
}

fn shared<T>(value: T) -> Arc<Mutex<T>> {
    Arc::new(Mutex::new(value))
}

/// Something of one's own, or shared.
#[derive(Debug)]
pub(crate) enum Tap<T> {
    Own(Box<T>),
    Shared(Arc<Mutex<T>>),
}

impl<T> Tap<T> {
    pub fn own(value: T) -> Self {
        Self::Own(Box::new(value))
    }

    pub fn with<R>(&mut self, work: impl FnOnce(&mut T) -> R) -> R {
        match self {
            Self::Own(value) => work(value),
            Self::Shared(value) => work(&mut value.lock().unwrap_or_else(PoisonError::into_inner)),
        }
    }
}

/// A copy is one's own from there on.
impl<T: Clone> Clone for Tap<T> {
    fn clone(&self) -> Self {
        match self {
            Self::Own(value) => Self::Own(value.clone()),
            Self::Shared(value) => {
                Self::own(value.lock().unwrap_or_else(PoisonError::into_inner).clone())
            }
        }
    }
}
