//! The files in memory in which the stages keep their counts.

use std::fs::File;
use std::io;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;

use rustix::fs::{MemfdFlags, memfd_create};
use tauscope_bus::shell::{Account, Ledger};

/// The counts of one stage. The file has no name and goes with the supervisor.
#[derive(Debug)]
pub struct Kept {
    file: File,
    length: usize,
}

impl Kept {
    /// For a stage with so many inputs.
    ///
    /// # Errors
    /// If the kernel gives no such file.
    pub fn new(inputs: usize) -> io::Result<Self> {
        let length = Ledger::length(inputs);
        let file = File::from(memfd_create("ledger", MemfdFlags::CLOEXEC)?);
        file.set_len(length as u64)?;
        Ok(Self { file, length })
    }

    /// Where the processes that this one starts find it.
    pub fn path(&self) -> PathBuf {
        let (process, file) = (std::process::id(), self.file.as_raw_fd());
        PathBuf::from(format!("/proc/{process}/fd/{file}"))
    }

    /// Another life begins.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn clear(&self) -> io::Result<()> {
        self.file.write_all_at(&vec![0; self.length], 0)
    }

    /// What the stage has noted in this life.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn account(&self) -> io::Result<Account> {
        let mut bytes = vec![0; self.length];
        self.file.read_exact_at(&mut bytes, 0)?;
        Ok(Account::read(&bytes))
    }
}
