//! What detectors of one stream derive alike, derived once.

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

/// Handed to detectors by [`Setup::shared`](crate::Setup::shared), it lets them take from one another what
/// they derive alike under the same settings, such as the arm's inertia in motion.
///
/// Only detectors that are given the very same samples one after the other may share, such as the
/// detectors behind one twin in a replay: whoever sees a sample first derives, the others find it done.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<Box<dyn Any + Send>>>>);

/// A value and the settings that it is derived under.
struct Under<S, T>(S, Arc<Mutex<T>>);

impl Shared {
    /// The value of this type that is shared under these settings; `new` where nobody has asked yet.
    pub(crate) fn tap<S, T>(&self, settings: S, new: impl FnOnce() -> T) -> Tap<T>
    where
        S: PartialEq + Send + 'static,
        T: Send + 'static,
    {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut alike = (all.iter()).filter_map(|any| any.downcast_ref::<Under<S, T>>());
        if let Some(Under(_, value)) = alike.find(|Under(of, _)| *of == settings) {
            return Tap::Shared(Arc::clone(value));
        }
        let value = Arc::new(Mutex::new(new()));
        all.push(Box::new(Under(settings, Arc::clone(&value))));
        Tap::Shared(value)
    }
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
