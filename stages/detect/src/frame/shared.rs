//! Values common to the detectors of one stream, computed once.

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

/// Values that several detectors compute equally under equal settings, such as the arm's inertial effort. Detectors
/// receive it through [`Setup::shared`](crate::Setup::shared).
///
/// Only detectors that receive identical samples in turn may share, such as the detectors behind one twin in a
/// replay: the first one to see a sample computes the value, the others reuse it.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<Box<dyn Any + Send>>>>);

/// A value and the settings under which it is computed.
struct Under<S, T>(S, Arc<Mutex<T>>);

impl Shared {
    /// Returns the shared value of this type under these settings; the first caller creates it by `new`.
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

/// An owned or shared value.
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

/// A clone of a shared value is owned.
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
