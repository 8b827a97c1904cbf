//! The register map, pure. It is described in `docs/publish.md`, which a test compares.

use std::time::Instant;

use tauscope_bus::command::LONGEST_MUTE_S;
use tokio_modbus::ExceptionCode;

use crate::message::AlarmState;
use crate::status::Status;

/// Version of the map, in the last register.
const VERSION: u16 = 1;
/// The coil that acknowledges when 1 is written.
pub const ACKNOWLEDGE: u16 = 16;
/// The holding register that mutes for so many seconds.
pub const MUTE_SECONDS: u16 = 0;
/// Names of the bits, from address 0: coils and discrete inputs alike.
pub const BITS: [&str; 6] = [
    "free",
    "contact",
    "collision",
    "acknowledged",
    "muted",
    "alive",
];
/// Names of the registers, from address 0: input registers and holding registers alike.
pub const WORDS: [&str; 10] = [
    "mute_s",
    "heartbeat",
    "state",
    "link",
    "force",
    "force_x",
    "force_y",
    "force_z",
    "age_ms",
    "version",
];
/// Forces are told in tenths of a newton.
const PER_N: f64 = 10.0;

/// All that can be read, at one instant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Registers {
    bits: [bool; BITS.len()],
    words: [u16; WORDS.len()],
}

/// What a write asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Write {
    /// The acknowledge coil was set to 0: nothing.
    Nothing,
    /// To acknowledge.
    Acknowledge,
    /// To mute.
    Mute {
        /// For so long \[s\].
        seconds: f64,
    },
}

impl Registers {
    /// What `status` reads as at the instant `now`.
    pub fn of(status: &Status, now: Instant) -> Self {
        let alarm = status.at(now);
        let state = alarm.state;
        let alive = state != AlarmState::Silent;
        let [x, y, z] = alarm.force_n.unwrap_or_default();
        let length = (x * x + y * y + z * z).sqrt();
        let signed = |newton: f64| (newton * PER_N).round() as i16 as u16;
        let age_ms = status.age(now).map_or(u16::MAX, |age| {
            u16::try_from(age.as_millis()).unwrap_or(u16::MAX)
        });
        Self {
            bits: [
                alarm.free,
                alarm.contact,
                state == AlarmState::Collision,
                state == AlarmState::Acknowledged,
                alarm.muted_s > 0.0,
                alive,
            ],
            words: [
                alarm.muted_s.ceil() as u16,
                status.detections as u16,
                state.number(),
                status.link_number,
                (length * PER_N).round() as u16,
                signed(x),
                signed(y),
                signed(z),
                age_ms,
                VERSION,
            ],
        }
    }

    /// `count` bits from address `at`. The acknowledge coil reads as 0.
    ///
    /// # Errors
    /// If one of them does not exist.
    pub fn bits(&self, at: u16, count: u16) -> Result<Vec<bool>, ExceptionCode> {
        if (at, count) == (ACKNOWLEDGE, 1) {
            return Ok(vec![false]);
        }
        part(&self.bits, at, count)
    }

    /// `count` registers from address `at`.
    ///
    /// # Errors
    /// If one of them does not exist.
    pub fn words(&self, at: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        part(&self.words, at, count)
    }
}

fn part<T: Copy>(all: &[T], at: u16, count: u16) -> Result<Vec<T>, ExceptionCode> {
    let (at, count) = (usize::from(at), usize::from(count));
    all.get(at..at + count)
        .map(<[T]>::to_vec)
        .ok_or(ExceptionCode::IllegalDataAddress)
}

/// What it means to write `value` to the coil `at`.
///
/// # Errors
/// If it cannot be written.
pub fn coil(at: u16, value: bool) -> Result<Write, ExceptionCode> {
    match (at, value) {
        (ACKNOWLEDGE, true) => Ok(Write::Acknowledge),
        (ACKNOWLEDGE, false) => Ok(Write::Nothing),
        _ => Err(ExceptionCode::IllegalDataAddress),
    }
}

/// What it means to write `value` to the holding register `at`.
///
/// # Errors
/// If it cannot be written, or not this value.
pub fn word(at: u16, value: u16) -> Result<Write, ExceptionCode> {
    match at {
        MUTE_SECONDS if f64::from(value) <= LONGEST_MUTE_S => Ok(Write::Mute {
            seconds: f64::from(value),
        }),
        MUTE_SECONDS => Err(ExceptionCode::IllegalDataValue),
        _ => Err(ExceptionCode::IllegalDataAddress),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn bit(registers: &Registers, name: &str) -> bool {
        registers.bits[BITS.iter().position(|each| *each == name).unwrap()]
    }

    fn word_of(registers: &Registers, name: &str) -> u16 {
        registers.words[WORDS.iter().position(|each| *each == name).unwrap()]
    }

    fn status(now: Instant) -> Status {
        let mut status = Status::silent(Duration::from_millis(500));
        status.alarm.state = AlarmState::Free;
        status.alarm.free = true;
        status.heard = Some(now);
        status
    }

    #[test]
    fn free_is_one_only_while_samples_come() {
        let now = Instant::now();
        let status = status(now);
        let read = |ms| Registers::of(&status, now + Duration::from_millis(ms));
        assert!(bit(&read(500), "free") && bit(&read(500), "alive"));
        assert!(!bit(&read(501), "free") && !bit(&read(501), "alive"));
        assert_eq!(word_of(&read(501), "state"), AlarmState::Silent.number());
        assert_eq!(word_of(&read(501), "age_ms"), 501);
        assert_eq!(word_of(&read(1_000_000), "age_ms"), u16::MAX);
        let never = Registers::of(&Status::silent(Duration::from_secs(1)), now);
        assert!(!bit(&never, "free"));
    }

    #[test]
    fn a_force_is_in_tenths_of_a_newton_and_stays_within_its_register() {
        let now = Instant::now();
        let mut status = status(now);
        status.alarm.force_n = Some([3.0, -4.0, 0.0]);
        let registers = Registers::of(&status, now);
        assert_eq!(word_of(&registers, "force"), 50);
        assert_eq!(word_of(&registers, "force_y") as i16, -40);
        status.alarm.force_n = Some([1e9, -1e9, f64::NAN]);
        let registers = Registers::of(&status, now);
        assert_eq!(word_of(&registers, "force_x") as i16, i16::MAX);
        assert_eq!(word_of(&registers, "force_y") as i16, i16::MIN);
    }

    #[test]
    fn what_is_outside_the_map_is_refused() {
        let now = Instant::now();
        let registers = Registers::of(&status(now), now);
        assert_eq!(registers.bits(0, 6).unwrap().len(), 6);
        assert_eq!(registers.bits(ACKNOWLEDGE, 1), Ok(vec![false]));
        assert_eq!(registers.bits(5, 2), Err(ExceptionCode::IllegalDataAddress));
        assert_eq!(registers.words(9, 1), Ok(vec![VERSION]));
        assert_eq!(
            registers.words(u16::MAX, 2),
            Err(ExceptionCode::IllegalDataAddress)
        );
        assert_eq!(coil(0, true), Err(ExceptionCode::IllegalDataAddress));
        assert_eq!(coil(ACKNOWLEDGE, true), Ok(Write::Acknowledge));
        assert_eq!(word(MUTE_SECONDS, 60), Ok(Write::Mute { seconds: 60.0 }));
        assert_eq!(word(MUTE_SECONDS, 61), Err(ExceptionCode::IllegalDataValue));
        assert_eq!(word(1, 0), Err(ExceptionCode::IllegalDataAddress));
    }

    #[test]
    fn the_map_is_the_documented_one() {
        let page = include_str!("../../../../docs/publish.md");
        for (at, name) in BITS.iter().enumerate().chain(WORDS.iter().enumerate()) {
            let row = format!("| {at} | `{name}` |");
            assert!(page.contains(&row), "docs/publish.md has no row {row}");
        }
        assert!(page.contains(&format!("| {ACKNOWLEDGE} | `acknowledge` |")));
    }
}
