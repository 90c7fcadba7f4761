//! Memory that factors leave to the next one: asking the system for it takes as long as the numbers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use super::multifrontal::Fronts;
use super::pages::Pages;
use super::probe::ProbeMemory;
use super::tiles::Column;

/// Memory that a factor shares with those that it was changed from.
#[derive(Clone, Default)]
pub(super) struct SharedMemory(Arc<Mutex<Memory>>);

/// Memory for one factorisation at a time.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) fronts: Fronts,
    pub(super) probe: ProbeMemory,
    pub(super) contributions: Spare<Column>,
    pub(super) panels: Pages,
}

impl SharedMemory {
    pub(super) fn lock(&self) -> MutexGuard<'_, Memory> {
        // What it holds is overwritten before it is read.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Nothing while another thread works in it, as one of the parent of a process does for ever.
    pub(super) fn try_lock(&self) -> Option<MutexGuard<'_, Memory>> {
        match self.0.try_lock() {
            Ok(memory) => Some(memory),
            Err(TryLockError::Poisoned(error)) => Some(error.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// Whether another factor can use it.
    pub(super) fn is_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }
}

impl Memory {
    /// Takes the memory of a factor back, or leaves it to the system if there is as much already.
    pub(super) fn give_panels(&mut self, panels: Pages) {
        if panels.size() > self.panels.size() {
            self.panels = panels;
        }
    }

    /// Gives back to the system what no factor has taken.
    pub(super) fn trim(&mut self) {
        self.contributions.0.clear();
        self.panels = Pages::default();
    }
}

/// Vectors that are not used, small ones first.
pub(super) struct Spare<T>(Vec<Vec<T>>);

impl<T> Default for Spare<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Copy> Spare<T> {
    /// A vector of `size` entries of any value, `value` where they are new.
    pub(super) fn take(&mut self, size: usize, value: T) -> Vec<T> {
        let place = self.0.partition_point(|vector| vector.capacity() < size);
        let fits = self.0.get(place).is_some_and(|vector| vector.capacity() <= 2 * size);
        let mut vector = if fits { self.0.remove(place) } else { Vec::with_capacity(size) };
        vector.resize(size, value);
        vector
    }

    /// Takes a vector back, if nothing else uses it.
    pub(super) fn give(&mut self, vector: Arc<Vec<T>>) {
        if let Some(vector) = Arc::into_inner(vector) {
            let place = self.0.partition_point(|other| other.capacity() < vector.capacity());
            self.0.insert(place, vector);
        }
    }
}
