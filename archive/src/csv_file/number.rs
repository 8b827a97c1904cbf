//! Numbers in cells, with a decimal point or a decimal comma.

/// Reads numbers. The first number with a decimal sign settles which sign the table has.
#[derive(Debug)]
pub(super) struct Numbers {
    /// Whether a comma can be a decimal sign: it is no delimiter.
    may_have_commas: bool,
    sign: Option<Sign>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sign {
    Point,
    Comma,
}

impl Numbers {
    pub(super) fn new(delimiter: u8) -> Self {
        Self {
            may_have_commas: delimiter != b',',
            sign: None,
        }
    }

    /// The number in a cell. An empty cell is NaN, as spreadsheets and pandas write it.
    pub(super) fn number(&mut self, cell: &[u8]) -> Option<f64> {
        let text = std::str::from_utf8(cell).ok()?;
        if text.is_empty() {
            return Some(f64::NAN);
        }
        if !self.may_have_commas {
            return text.parse().ok();
        }
        let (number, sign) = match text.split_once(',') {
            None if text.contains('.') => (text.parse().ok()?, Sign::Point),
            None => return text.parse().ok(),
            Some(_) if text.contains('.') => return None,
            Some((whole, rest)) => (format!("{whole}.{rest}").parse().ok()?, Sign::Comma),
        };
        // `1,234` among decimal points is one thousand, or a slip.
        let settled = *self.sign.get_or_insert(sign);
        (settled == sign).then_some(number)
    }

    pub(super) fn have_commas(&self) -> bool {
        self.sign == Some(Sign::Comma)
    }
}
