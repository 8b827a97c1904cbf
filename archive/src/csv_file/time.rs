//! The time in a cell: a date, or a number in some unit.

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;

use super::limits::TIME_S;
use super::number::Numbers;

const NS_PER_S: f64 = 1e9;

/// Format of the time's cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Clock {
    /// Numbers in this unit \[ns\].
    Numbers { unit_ns: u64 },
    /// Dates of ISO 8601.
    Dates,
}

impl Clock {
    pub(super) const SECONDS: Self = Self::Numbers {
        unit_ns: 1_000_000_000,
    };

    /// The time in a cell \[ns\], from 0 to what a ROS stamp can hold.
    pub(super) fn time_ns(self, cell: &[u8], numbers: &mut Numbers) -> Option<i64> {
        let most_ns = TIME_S * NS_PER_S;
        let time_ns = match self {
            Self::Dates => date_ns(cell)?,
            Self::Numbers { unit_ns } => {
                // Nanoseconds since 1970 have more digits than a float.
                if let Some(whole) = whole(cell) {
                    whole.checked_mul(i64::try_from(unit_ns).ok()?)?
                } else {
                    let time_ns = (numbers.number(cell)? * unit_ns as f64).round();
                    // NaN is outside of the range, and a cast makes it 0.
                    (0.0..=most_ns)
                        .contains(&time_ns)
                        .then_some(time_ns as i64)?
                }
            }
        };
        (0..=most_ns as i64).contains(&time_ns).then_some(time_ns)
    }
}

fn whole(cell: &[u8]) -> Option<i64> {
    std::str::from_utf8(cell).ok()?.parse().ok()
}

/// The time of a date of ISO 8601 with a time of day \[ns since the epoch\], in UTC if it names no zone.
pub(super) fn date_ns(cell: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(cell).ok()?;
    // Eight digits are a date, too, but in a table they are a number.
    if text.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let time = text.parse::<Timestamp>().or_else(|_| {
        let civil = text.parse::<DateTime>()?;
        Ok::<_, jiff::Error>(civil.to_zoned(TimeZone::UTC)?.timestamp())
    });
    i64::try_from(time.ok()?.as_nanosecond()).ok()
}
