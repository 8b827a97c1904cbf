//! Sequential access to the rows of a column.

use std::sync::Arc;

use super::ParquetFile;
use super::error::{ParquetError, ParquetProblem};
use super::page::{self, DataPage, Entry, Page, PageProblem};

/// Maximum number of values in a row.
/// Resolution: bounds memory; a humanoid has some hundreds.
const MAX_WIDTH: usize = 1 << 14;

/// Cursor over the rows of a column. It holds the current page and its dictionary.
pub(crate) struct Rows {
    file: Arc<ParquetFile>,
    /// Index among the selected columns.
    column: usize,
    group: usize,
    /// Number of rows read in the current group.
    read: u64,
    /// Number of rows in the preceding groups.
    before: u64,
    /// File offset of the next page; `None` before the first one of a group.
    next_page: Option<u64>,
    dictionary: Vec<u8>,
    page: DataPage,
    /// First entry of the next row, which is read to find the end of the current row.
    waiting: Option<Entry>,
}

impl Rows {
    /// Opens the selected column with the index `column`, starting at row `first`.
    pub(super) fn open(
        file: Arc<ParquetFile>,
        column: usize,
        first: u64,
    ) -> Result<Self, ParquetError> {
        let mut rows = Self {
            file,
            column,
            group: 0,
            read: 0,
            before: 0,
            next_page: None,
            dictionary: Vec::new(),
            page: DataPage::default(),
            waiting: None,
        };
        let file = Arc::clone(&rows.file);
        while let Some(group) = file.footer.groups.get(rows.group)
            && first - rows.before >= group.rows
        {
            rows.before += group.rows;
            rows.group += 1;
        }
        // Rows within a group have no known offsets, so those before `first` are decoded and discarded.
        let mut skipped = Vec::new();
        for _ in rows.before..first {
            if !rows.next_row(&mut skipped)? {
                break;
            }
        }
        Ok(rows)
    }

    /// Reads the numbers of the next row into `row`; returns `false` at the end. A null value is NaN.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn next_row(&mut self, row: &mut Vec<f64>) -> Result<bool, ParquetError> {
        row.clear();
        loop {
            let Some(group) = self.file.footer.groups.get(self.group) else {
                return Ok(false);
            };
            if self.read < group.rows {
                break;
            }
            if self.waiting.is_some() || self.next_entry()?.is_some() {
                return Err(self.damaged("there are more rows than the footer says"));
            }
            self.before += self.read;
            self.read = 0;
            self.group += 1;
            self.next_page = None;
            self.dictionary.clear();
        }
        let first = match self.waiting.take() {
            Some(entry) => Some(entry),
            None => self.next_entry()?,
        };
        let Some(first) = first else {
            return Err(self.damaged("there are fewer rows than the footer says"));
        };
        if !first.begins_row {
            return Err(self.damaged("a list begins within a list"));
        }
        row.extend(first.value);
        while let Some(entry) = self.next_of_row()? {
            row.extend(entry.value);
            if row.len() > MAX_WIDTH {
                return Err(self.damaged("a list is longer than any of joints"));
            }
        }
        self.read += 1;
        Ok(true)
    }

    /// Returns the next entry, if it belongs to the current row.
    fn next_of_row(&mut self) -> Result<Option<Entry>, ParquetError> {
        if !self.file.footer.leaves[self.column].is_list {
            return Ok(None);
        }
        let entry = self.next_entry()?;
        if entry.is_some_and(|entry| entry.begins_row) {
            self.waiting = entry;
            return Ok(None);
        }
        Ok(entry)
    }

    /// Returns the next entry of the group.
    fn next_entry(&mut self) -> Result<Option<Entry>, ParquetError> {
        while self.page.left == 0 {
            if !self.turn_page()? {
                return Ok(None);
            }
        }
        let leaf = &self.file.footer.leaves[self.column];
        let entry = self.page.entry(leaf, &self.dictionary);
        let entry = entry.ok_or_else(|| self.damaged("a page ends before its last number"))?;
        Ok(Some(entry))
    }

    /// Reads the next page of the group; returns `false` at its end.
    fn turn_page(&mut self) -> Result<bool, ParquetError> {
        let chunk = self.file.footer.groups[self.group].chunks[self.column];
        let at = self.next_page.unwrap_or(chunk.start);
        if at >= chunk.start + chunk.bytes {
            return Ok(false);
        }
        let leaf = &self.file.footer.leaves[self.column];
        let (page, next) =
            page::read(&self.file, leaf, &chunk, at).map_err(|problem| match problem {
                PageProblem::Damaged(reason) => self.damaged(reason),
                PageProblem::Refused(problem) => ParquetError::new(&self.file.path, problem),
            })?;
        self.next_page = Some(next);
        match page {
            Page::Dictionary(numbers) => self.dictionary = numbers,
            Page::Data(page) => self.page = page,
            Page::Other => {}
        }
        Ok(true)
    }

    fn damaged(&self, reason: &'static str) -> ParquetError {
        let problem = ParquetProblem::Page {
            column: self.file.footer.leaves[self.column].name.clone(),
            row: self.before + self.read,
            reason,
        };
        ParquetError::new(&self.file.path, problem)
    }
}
