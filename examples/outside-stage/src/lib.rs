//! Raises an alarm while any joint's residual exceeds a threshold, and until it has stayed below it for a hold time.

use serde::Deserialize;
use tauscope_bus::{Detection, Emit, Name, Seat, Stage, StageError, TwinState, flags};

/// Settings in the pipeline file: `outside: {command: [...], settings: {threshold: 8.0}}`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Residual that raises the alarm, in the cell's effort unit.
    pub threshold: f64,
    /// Time for which the residual must stay below the threshold to end the alarm \[s\].
    pub hold_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            threshold: 10.0,
            hold_s: 0.2,
        }
    }
}

impl Config {
    /// Settings of the seat; the defaults without any.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn of(seat: &Seat) -> Result<Self, serde_json::Error> {
        if seat.config.is_null() {
            return Ok(Self::default());
        }
        serde_json::from_value(seat.config.clone())
    }
}

/// A threshold on the largest residual of all joints.
pub struct PeakResidual {
    config: Config,
    /// During an alarm: its start, and the last time at which the residual exceeded the threshold.
    alarm: Option<(i64, i64)>,
}

impl PeakResidual {
    /// Creates the stage without an alarm.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            alarm: None,
        }
    }

    /// Returns the alarm state of the next sample, and its event.
    fn judge(&mut self, stamp_ns: i64, score: f64) -> (bool, u32) {
        let beyond = score > self.config.threshold;
        match self.alarm {
            None if beyond => {
                self.alarm = Some((stamp_ns, stamp_ns));
                (true, Detection::ONSET)
            }
            None => (false, 0),
            Some((began, _)) if beyond => {
                self.alarm = Some((began, stamp_ns));
                (true, 0)
            }
            Some((_, last)) if (stamp_ns - last) as f64 * 1e-9 >= self.config.hold_s => {
                self.alarm = None;
                (false, Detection::OFFSET)
            }
            Some(_) => (true, 0),
        }
    }
}

impl Stage<TwinState, Detection> for PeakResidual {
    fn accept(
        &mut self,
        twin: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let ready = twin.header.has(flags::READY);
        let joints = &twin.residual[..twin.header.joint_count as usize];
        let score = joints.iter().fold(0.0, |peak: f64, r| peak.max(r.abs()));
        if twin.header.has(flags::RESET) {
            self.alarm = None;
        }
        let (alarm, event) = if ready {
            self.judge(twin.header.stamp_ns, score)
        } else {
            (false, 0)
        };
        let beyond = joints.iter().enumerate();
        let beyond = beyond.filter(|(_, r)| alarm && r.abs() > self.config.threshold);
        let beyond = beyond.fold(0, |bits, (joint, _)| bits | 1 << joint);
        out.emit(&mut |detection| {
            detection.header = twin.header;
            detection.header.flags &= flags::READY | flags::RESET;
            if alarm {
                detection.header.flags |= flags::ALARM;
            }
            detection.detector = Name::new("peak_residual");
            detection.state = Name::new(match (ready, alarm) {
                (false, _) => "not_ready",
                (true, false) => "free",
                (true, true) => "contact",
            });
            detection.score = score;
            detection.threshold = self.config.threshold;
            detection.contact_ns = self.alarm.map_or(0, |(began, _)| began);
            detection.joints = beyond;
            detection.event = event;
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tauscope_bus::LinkError;

    #[derive(Default)]
    struct Seen(Vec<Detection>);

    impl Emit<Detection> for Seen {
        fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
            let mut detection = Detection::default();
            write(&mut detection);
            self.0.push(detection);
            Ok(())
        }
    }

    /// A residual on joint 2 from 1.0 s to 1.5 s at 100 Hz.
    fn run(flags: u32) -> Vec<Detection> {
        let mut stage = PeakResidual::new(Config::default());
        let mut seen = Seen::default();
        for n in 0..300 {
            let mut twin = TwinState::default();
            twin.header.stamp_ns = n * 10_000_000;
            twin.header.joint_count = 3;
            twin.header.flags = flags;
            twin.residual[2] = if (100..150).contains(&n) { -12.0 } else { 1.0 };
            stage.accept(&twin, &mut seen).unwrap();
        }
        seen.0
    }

    #[test]
    fn a_peak_is_one_alarm() {
        let seen = run(flags::READY);
        let at = |event| seen.iter().position(|d| d.event == event);
        assert_eq!(at(Detection::ONSET), Some(100));
        // The last sample above the threshold is 149, and 0.2 s are 20 samples.
        assert_eq!(at(Detection::OFFSET), Some(169));
        assert_eq!(seen[120].joints, 0b100);
        assert_eq!(seen[120].contact_ns, 1_000_000_000);
        assert_eq!(seen.iter().filter(|d| d.event != 0).count(), 2);
    }

    #[test]
    fn nothing_is_judged_before_the_twin_is_ready() {
        assert!(run(0).iter().all(|d| !d.alarm() && d.event == 0));
    }
}
