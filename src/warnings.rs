//! Log output: warnings of stages and errors of libraries, on standard error.

use tracing::{Metadata, Subscriber};
use tracing_subscriber::filter::{FilterExt as _, LevelFilter, Targets, filter_fn};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::prelude::*;

/// Starts to write the log to standard error.
pub fn show(coloured: bool) {
    subscriber(std::io::stderr, coloured).init();
}

fn subscriber(
    writer: impl for<'a> MakeWriter<'a> + Send + Sync + 'static,
    coloured: bool,
) -> impl Subscriber + Send + Sync {
    let targets = Targets::new()
        .with_default(LevelFilter::ERROR)
        .with_target("tauscope", LevelFilter::WARN);
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(writer)
        .with_ansi(coloured)
        .without_time()
        .with_target(false);
    let said = targets.and(filter_fn(|event| !is_goodbye_unheard(event)));
    tracing_subscriber::registry().with(lines.with_filter(said))
}

/// Whether an event is the timeout of a Zenoh session that closes. A session that is dropped notifies its peers; if
/// one of them does not answer for 10 s, it logs `close operation timed out!` with a path of Zenoh's source code.
/// This happens at the end of a run and has no remedy, and undelivered samples are counted by the links. The event
/// has an error and no message; all other events of that module have a message, and are shown.
fn is_goodbye_unheard(event: &Metadata<'_>) -> bool {
    event.target() == "zenoh::api::session" && event.fields().field("message").is_none()
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io::Write;
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn the_goodbye_of_a_session_that_nobody_hears_is_not_the_users_business() {
        let kept = Kept::default();
        let writer = kept.clone();
        tracing::subscriber::with_default(subscriber(move || writer.clone(), false), || {
            // As Zenoh logs it.
            let error: Box<dyn Error + Send + Sync> =
                "close operation timed out! at /src/close.rs:135.".into();
            tracing::error!(target: "zenoh::api::session", error);
            tracing::error!(target: "zenoh::api::session", "an error with a message");
            tracing::warn!(target: "tauscope_ingest::recorded", "a warning of ours");
            tracing::warn!(target: "zenoh::net", "a warning of a library");
        });
        let text = String::from_utf8(kept.0.lock().unwrap().clone()).unwrap();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        assert_eq!(
            lines,
            ["ERROR an error with a message", "WARN a warning of ours"]
        );
    }
}
