//! Reports on a stage that receives nothing usable: at once, again when the reason changes, at growing intervals
//! while it lasts, and at its end.

use std::time::{Duration, Instant};

use tauscope_bus::Trouble;

/// Time after which trouble that lasts is reported again, in short; each further interval is twice the previous one.
const FIRST_REMINDER: Duration = Duration::from_secs(30);
/// Longest such interval.
const LONGEST_REMINDER: Duration = Duration::from_mins(10);

/// Time without samples after which a source is treated as silent.
const SILENT: Duration = Duration::from_secs(1);

/// Reported trouble of one stage.
#[derive(Debug, Default)]
pub struct Silence {
    told: Option<Told>,
}

#[derive(Debug)]
struct Told {
    trouble: Trouble,
    /// Whether the stage was silent when the trouble was first reported.
    was_silent: bool,
    since: Instant,
    reminder: Instant,
    wait: Duration,
}

impl Silence {
    /// Takes the current trouble, if any, and the time since the newest sample. Returns the text to report, if any,
    /// and whether it is a warning.
    pub fn note(
        &mut self,
        trouble: Option<&Trouble>,
        silent_for: Duration,
        now: Instant,
    ) -> Option<(bool, String)> {
        let Some(trouble) = trouble else {
            let told = self.told.take()?;
            let lasted = (now - told.since).as_secs_f64();
            let over = if told.was_silent {
                format!("samples come again after {lasted:.0} s")
            } else {
                format!("over after {lasted:.0} s: {}", told.trouble.what)
            };
            return Some((false, over));
        };
        let seconds = silent_for.as_secs_f64();
        match &mut self.told {
            Some(told) if told.trouble.is_like(trouble) => {
                if now < told.reminder {
                    return None;
                }
                told.wait = (told.wait * 2).min(LONGEST_REMINDER);
                told.reminder = now + told.wait;
                Some((true, format!("still: {} ({seconds:.0} s)", trouble.what)))
            }
            told => {
                let since = told
                    .as_ref()
                    .map_or(now.checked_sub(silent_for).unwrap_or(now), |told| {
                        told.since
                    });
                let is_silent = silent_for >= SILENT;
                *told = Some(Told {
                    trouble: trouble.clone(),
                    was_silent: is_silent,
                    since,
                    reminder: now + FIRST_REMINDER,
                    wait: FIRST_REMINDER,
                });
                let age = if is_silent {
                    format!("no usable sample for {seconds:.0} s: ")
                } else {
                    String::new()
                };
                Some((true, format!("{age}{trouble}")))
            }
        }
    }

    /// Returns the reported trouble that is not over.
    pub fn trouble(&self) -> Option<&Trouble> {
        self.told.as_ref().map(|told| &told.trouble)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trouble_is_told_once_then_seldom_and_its_end_is_told() {
        let start = Instant::now();
        let mut silence = Silence::default();
        let trouble = Trouble::new("no publisher of a/b");
        let mut said = Vec::new();
        for second in 3..100 {
            let silent_for = Duration::from_secs(second);
            if let Some((warns, text)) =
                silence.note(Some(&trouble), silent_for, start + silent_for)
            {
                assert!(warns);
                said.push(text);
            }
        }
        let expected = [
            "no usable sample for 3 s: no publisher of a/b",
            "still: no publisher of a/b (33 s)",
            "still: no publisher of a/b (93 s)",
        ];
        assert_eq!(said, expected);
        let end = start + Duration::from_secs(100);
        let over = silence.note(None, Duration::ZERO, end);
        assert_eq!(
            over,
            Some((false, "samples come again after 100 s".to_owned()))
        );
        assert_eq!(silence.note(None, Duration::ZERO, end), None);
    }

    #[test]
    fn trouble_of_a_stream_that_flows_does_not_speak_of_silence() {
        let start = Instant::now();
        let mut silence = Silence::default();
        let trouble = Trouble::new("two publishers");
        let said = silence.note(Some(&trouble), Duration::ZERO, start);
        assert_eq!(said, Some((true, "two publishers".to_owned())));
        let over = silence.note(None, Duration::ZERO, start + Duration::from_secs(7));
        let expected = "over after 7 s: two publishers";
        assert_eq!(over, Some((false, expected.to_owned())));
    }

    #[test]
    fn another_trouble_is_told_at_once() {
        let start = Instant::now();
        let mut silence = Silence::default();
        let three = Duration::from_secs(3);
        silence.note(Some(&Trouble::new("no router")), three, start + three);
        let other = silence.note(
            Some(&Trouble::new("no publisher")),
            three * 2,
            start + three * 2,
        );
        assert_eq!(
            other,
            Some((true, "no usable sample for 6 s: no publisher".to_owned()))
        );
    }
}
