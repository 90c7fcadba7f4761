//! Ends the program when an input takes too long, after writing it down.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// What is tried now, since when.
type Current = Arc<Mutex<Option<(Start, Vec<u8>)>>>;

/// On a busy machine a program may wait for long without hanging: as many times the limit.
const PATIENCE: u32 = 60;

/// When an input began.
#[derive(Clone, Copy)]
struct Start {
    time: Instant,
    computed: Duration,
}

impl Start {
    fn is_over(self, limit: Duration) -> bool {
        computed().saturating_sub(self.computed) > limit || self.time.elapsed() > PATIENCE * limit
    }
}

/// Time for which the process has computed; where the system does not tell, the time that has passed. On a
/// busy machine the clock goes on while a program waits.
pub(crate) fn computed() -> Duration {
    static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let passed = || BEGIN.get_or_init(Instant::now).elapsed();
    let told = std::fs::read_to_string("/proc/self/stat").ok();
    told.and_then(|text| cpu_time(&text)).unwrap_or_else(passed)
}

/// User and system time of all threads, in the text of Linux's `stat`: its 14th and 15th field, ticks of 10 ms.
fn cpu_time(stat: &str) -> Option<Duration> {
    // The second field is the program's name in brackets, which may hold spaces.
    let (_, fields) = stat.rsplit_once(')')?;
    let mut ticks = fields.split_whitespace().skip(11).map_while(|field| field.parse::<u64>().ok());
    Some(Duration::from_millis(10 * (ticks.next()? + ticks.next()?)))
}

/// Looks at the input under way every second.
#[derive(Default)]
pub(crate) struct Watchdog {
    current: Current,
    started: bool,
}

impl Watchdog {
    /// An input begins; the first starts the thread that watches.
    pub(crate) fn begin(&mut self, input: &[u8], limit: Duration, file: PathBuf) {
        *self.current.lock().unwrap_or_else(PoisonError::into_inner) =
            Some((Start { time: Instant::now(), computed: computed() }, input.to_vec()));
        if self.started {
            return;
        }
        self.started = true;
        let current = Arc::clone(&self.current);
        thread::spawn(move || {
            loop {
                thread::sleep(Duration::from_millis(500));
                if Arc::strong_count(&current) == 1 {
                    return;
                }
                let guard = current.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some((start, input)) =
                    guard.as_ref().filter(|(start, _)| start.is_over(limit))
                {
                    let written = std::fs::create_dir_all(file.parent().unwrap_or(&file))
                        .and_then(|()| std::fs::write(&file, input));
                    eprintln!(
                        "an input still runs after {:.0} s: {} ({written:?})",
                        start.time.elapsed().as_secs_f64(),
                        file.display()
                    );
                    std::process::exit(1);
                }
            }
        });
    }

    /// The input has come to its end.
    pub(crate) fn end(&self) {
        *self.current.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_computed_is_that_of_all_threads() {
        let text = "7 (a (b) c) R 1 2 3 4 5 6 7 8 9 10 250 50 0 0 20";
        assert_eq!(cpu_time(text), Some(Duration::from_secs(3)));
        assert_eq!(cpu_time("7 (short) R 1"), None);
    }
}
