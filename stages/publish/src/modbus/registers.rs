//! The register map. Pure. A test compares it with its description in `docs/publish.md`.

use std::time::Instant;

use tauscope_bus::command::LONGEST_MUTE_S;
use tokio_modbus::ExceptionCode;

use crate::message::AlarmState;
use crate::status::Status;

/// Version of the map, in the last register.
const VERSION: u16 = 2;
/// Coil that acknowledges when 1 is written.
pub const ACKNOWLEDGE: u16 = 16;
/// Coil that makes the detectors relearn when 1 is written.
pub const LEARN: u16 = 17;
/// Holding register that mutes for the written number of seconds.
pub const MUTE_SECONDS: u16 = 0;
/// First of the write-only holding registers.
pub const PAYLOAD: u16 = 16;
/// Holding register that records a number in the archive.
pub const LABEL: u16 = 20;
/// Names of the write-only registers, which read as 0, from [`PAYLOAD`] on. A payload is written alone or with its
/// centre of mass.
pub const WRITTEN: [&str; 5] = [
    "payload_mass",
    "payload_x",
    "payload_y",
    "payload_z",
    "label",
];
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
/// Register counts per newton: forces are in tenths of a newton.
const PER_N: f64 = 10.0;
/// Register counts per kilogram: masses are in hundredths of a kilogram.
const PER_KG: f64 = 100.0;
/// Register counts per metre: positions are in millimetres.
const PER_M: f64 = 1000.0;

/// All readable values at one instant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Registers {
    bits: [bool; BITS.len()],
    words: [u16; WORDS.len()],
}

/// Command requested by a write.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Write {
    /// No command: a coil was set to 0.
    Nothing,
    /// Acknowledgement.
    Acknowledge,
    /// Mute.
    Mute {
        /// Duration \[s\].
        seconds: f64,
    },
    /// Change of the payload.
    Payload {
        /// Mass \[kg\].
        mass_kg: f64,
        /// Centre of mass in the tool link's frame \[m\].
        com_m: [f64; 3],
    },
    /// Relearning.
    Learn,
    /// A number for the archive.
    Label(u16),
}

impl Registers {
    /// Returns the values of `status` at the instant `now`.
    pub fn of(status: &Status, now: Instant) -> Self {
        let alarm = status.at(now);
        let state = alarm.state;
        let alive = state != AlarmState::Silent;
        // Silence releases no latch: the bits of one are those of the newest detection.
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
                status.alarm.state == AlarmState::Collision,
                status.alarm.state == AlarmState::Acknowledged,
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

    /// Returns `count` bits from address `at`. Write-only coils read as 0.
    ///
    /// # Errors
    /// If one of them does not exist.
    pub fn bits(&self, at: u16, count: u16) -> Result<Vec<bool>, ExceptionCode> {
        part(&self.bits, at, count).or_else(|error| {
            let written = [false; (LEARN - ACKNOWLEDGE + 1) as usize];
            part(&written, at.checked_sub(ACKNOWLEDGE).ok_or(error)?, count)
        })
    }

    /// Returns `count` registers from address `at`. Write-only registers read as 0.
    ///
    /// # Errors
    /// If one of them does not exist.
    pub fn words(&self, at: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        part(&self.words, at, count).or_else(|error| {
            let written = [0; WRITTEN.len()];
            part(&written, at.checked_sub(PAYLOAD).ok_or(error)?, count)
        })
    }
}

fn part<T: Copy>(all: &[T], at: u16, count: u16) -> Result<Vec<T>, ExceptionCode> {
    let (at, count) = (usize::from(at), usize::from(count));
    all.get(at..at + count)
        .map(<[T]>::to_vec)
        .ok_or(ExceptionCode::IllegalDataAddress)
}

/// Returns the command of writing `value` to the coil `at`.
///
/// # Errors
/// If it cannot be written.
pub fn coil(at: u16, value: bool) -> Result<Write, ExceptionCode> {
    match (at, value) {
        (ACKNOWLEDGE, true) => Ok(Write::Acknowledge),
        (LEARN, true) => Ok(Write::Learn),
        (ACKNOWLEDGE | LEARN, false) => Ok(Write::Nothing),
        _ => Err(ExceptionCode::IllegalDataAddress),
    }
}

/// Returns the command of writing `values` to the holding registers from `at` on.
///
/// # Errors
/// If they cannot be written, or if a value is not allowed.
pub fn words(at: u16, values: &[u16]) -> Result<Write, ExceptionCode> {
    match (at, values) {
        (MUTE_SECONDS, &[value]) if f64::from(value) <= LONGEST_MUTE_S => Ok(Write::Mute {
            seconds: f64::from(value),
        }),
        (MUTE_SECONDS, [_]) => Err(ExceptionCode::IllegalDataValue),
        (PAYLOAD, &[mass]) => Ok(payload(mass, [0; 3])),
        (PAYLOAD, &[mass, x, y, z]) => Ok(payload(mass, [x, y, z])),
        (LABEL, &[number]) => Ok(Write::Label(number)),
        _ => Err(ExceptionCode::IllegalDataAddress),
    }
}

fn payload(mass: u16, com: [u16; 3]) -> Write {
    Write::Payload {
        mass_kg: f64::from(mass) / PER_KG,
        com_m: com.map(|mm| f64::from(mm as i16) / PER_M),
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
    fn a_latch_reads_as_one_also_while_the_detector_is_silent() {
        let now = Instant::now();
        let mut status = status(now);
        for (state, name) in [
            (AlarmState::Collision, "collision"),
            (AlarmState::Acknowledged, "acknowledged"),
        ] {
            status.alarm.state = state;
            status.alarm.free = false;
            let silent = Registers::of(&status, now + Duration::from_mins(1));
            assert!(bit(&silent, name) && !bit(&silent, "free") && !bit(&silent, "alive"));
            assert_eq!(word_of(&silent, "state"), AlarmState::Silent.number());
        }
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
        assert_eq!(
            words(MUTE_SECONDS, &[60]),
            Ok(Write::Mute { seconds: 60.0 })
        );
        assert_eq!(
            words(MUTE_SECONDS, &[61]),
            Err(ExceptionCode::IllegalDataValue)
        );
        assert_eq!(words(1, &[0]), Err(ExceptionCode::IllegalDataAddress));
    }

    #[test]
    fn payload_learning_and_notes_are_written_and_read_as_0() {
        let payload = |mass_kg, com_m| Ok(Write::Payload { mass_kg, com_m });
        assert_eq!(words(PAYLOAD, &[150]), payload(1.5, [0.0; 3]));
        let minus_20 = -20_i16 as u16;
        assert_eq!(
            words(PAYLOAD, &[150, minus_20, 0, 250]),
            payload(1.5, [-0.02, 0.0, 0.25])
        );
        let refused = Err(ExceptionCode::IllegalDataAddress);
        assert_eq!(words(PAYLOAD, &[150, 0]), refused);
        assert_eq!(words(PAYLOAD + 1, &[5]), refused);
        assert_eq!(words(LABEL, &[17]), Ok(Write::Label(17)));
        assert_eq!(coil(LEARN, true), Ok(Write::Learn));
        assert_eq!(coil(LEARN, false), Ok(Write::Nothing));
        let now = Instant::now();
        let registers = Registers::of(&status(now), now);
        assert_eq!(registers.words(PAYLOAD, 5), Ok(vec![0; 5]));
        assert_eq!(registers.bits(ACKNOWLEDGE, 2), Ok(vec![false; 2]));
        assert_eq!(
            registers.bits(LEARN, 2),
            Err(ExceptionCode::IllegalDataAddress)
        );
    }

    #[test]
    fn the_map_is_the_documented_one() {
        let page = include_str!("../../../../docs/publish.md");
        for (at, name) in BITS.iter().enumerate().chain(WORDS.iter().enumerate()) {
            let row = format!("| {at} | `{name}` |");
            assert!(page.contains(&row), "docs/publish.md has no row {row}");
        }
        let coils = [(ACKNOWLEDGE, "acknowledge"), (LEARN, "learn")];
        let registers = (PAYLOAD..).zip(WRITTEN);
        for (at, name) in registers.chain(coils) {
            let row = format!("| {at} | `{name}` |");
            assert!(page.contains(&row), "docs/publish.md has no row {row}");
        }
        assert_eq!(WRITTEN[usize::from(LABEL - PAYLOAD)], "label");
    }
}
