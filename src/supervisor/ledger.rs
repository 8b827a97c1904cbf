//! In-memory files in which the stages keep their counts.

use std::fs::File;
use std::io;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;

use rustix::fs::{MemfdFlags, memfd_create};
use tauscope_bus::shell::{Account, Ledger};

/// The counts of one stage, in an anonymous file that exists as long as the supervisor.
#[derive(Debug)]
pub struct Kept {
    file: File,
    length: usize,
}

impl Kept {
    /// Creates the file of a stage with this number of inputs.
    ///
    /// # Errors
    /// If the kernel cannot create the file.
    pub fn new(inputs: usize) -> io::Result<Self> {
        let length = Ledger::length(inputs);
        let file = File::from(memfd_create("ledger", MemfdFlags::CLOEXEC)?);
        file.set_len(length as u64)?;
        Ok(Self { file, length })
    }

    /// Returns the path of the file for child processes of this one.
    pub fn path(&self) -> PathBuf {
        let (process, file) = (std::process::id(), self.file.as_raw_fd());
        PathBuf::from(format!("/proc/{process}/fd/{file}"))
    }

    /// Clears the counts for the next incarnation.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn clear(&self) -> io::Result<()> {
        self.file.write_all_at(&vec![0; self.length], 0)
    }

    /// Reads the counts of this incarnation.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn account(&self) -> io::Result<Account> {
        let mut bytes = vec![0; self.length];
        self.file.read_exact_at(&mut bytes, 0)?;
        Ok(Account::read(&bytes))
    }
}
