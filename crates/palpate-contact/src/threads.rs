//! The threads that parts of a step are divided among.

use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::SceneError;

/// Threads; clones are the same ones. Whoever calls from one of them loses no time with waking them,
/// so that all stages of a step should be run by one [`Self::run`].
#[derive(Clone, Debug, Default)]
pub struct Threads(Option<Arc<ThreadPool>>);

impl Threads {
    /// Starts so many; one is the caller's own.
    ///
    /// # Errors
    /// If `count` is zero, or the operating system gave no threads.
    pub fn new(count: usize) -> Result<Self, SceneError> {
        match count {
            0 => Err(SceneError::Threads),
            1 => Ok(Self(None)),
            threads => match ThreadPoolBuilder::new().num_threads(threads).build() {
                Ok(pool) => Ok(Self(Some(Arc::new(pool)))),
                Err(error) => Err(SceneError::ThreadPool { threads, reason: error.to_string() }),
            },
        }
    }

    /// Does `work` on one of the threads.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match self.pool() {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// The threads for what can be divided; `None` for a single one.
    pub fn pool(&self) -> Option<&ThreadPool> {
        self.0.as_deref()
    }
}
