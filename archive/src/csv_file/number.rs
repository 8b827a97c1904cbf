//! Numbers in cells, with a decimal point or a decimal comma.

/// Parser of numeric cells. The first cell with a decimal sign fixes that sign for the whole table.
#[derive(Debug)]
pub(super) struct Numbers {
    /// Whether a comma can be a decimal sign, because it is not the delimiter.
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

    /// Parses a cell. An empty cell is NaN, because spreadsheets and pandas write missing values as empty cells.
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
        // In a table with decimal points, `1,234` is a thousands separator or a typing error, so it is rejected.
        let settled = *self.sign.get_or_insert(sign);
        (settled == sign).then_some(number)
    }

    pub(super) fn have_commas(&self) -> bool {
        self.sign == Some(Sign::Comma)
    }
}
