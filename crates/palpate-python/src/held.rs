//! What several Python threads use in turn, and what a process that was forked finds without its threads.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::sync::MutexExt;

/// Something that owns worker threads.
pub(crate) trait Threaded: Send {
    /// Starts them anew; those of the parent do not run here. False where the system gives none.
    fn restart_threads(&mut self) -> bool;
}

/// A value behind a lock, in the process that started its threads.
pub(crate) struct Held<T> {
    value: Mutex<T>,
    process: AtomicU32,
}

impl<T: Threaded> Held<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { value: Mutex::new(value), process: AtomicU32::new(std::process::id()) }
    }

    /// For use where Python's lock is not held.
    pub(crate) fn lock(&self) -> MutexGuard<'_, T> {
        self.here(self.value.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// For use where Python's lock is held: let go while another thread works with the value.
    pub(crate) fn lock_attached(&self, py: Python<'_>) -> MutexGuard<'_, T> {
        self.here(self.value.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner))
    }

    fn here<'a>(&'a self, mut guard: MutexGuard<'a, T>) -> MutexGuard<'a, T> {
        let process = std::process::id();
        if self.process.load(Ordering::Relaxed) != process && guard.restart_threads() {
            self.process.store(process, Ordering::Relaxed);
        }
        guard
    }
}
