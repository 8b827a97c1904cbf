//! What the tests of detectors share.

use tauscope_bus::{Detection, Emit, LinkError};

/// Keeps all that a stage says.
#[derive(Default)]
pub struct Out(pub Vec<Detection>);

impl Emit<Detection> for Out {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let mut detection = Detection::default();
        write(&mut detection);
        self.0.push(detection);
        Ok(())
    }
}
