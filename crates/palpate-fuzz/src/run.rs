//! The loop: mutate, try, keep what behaves in another way, make shorter what fails.

use std::collections::BTreeSet;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use palpate_testing::{Random, peak_of};

use crate::mutate::mutated;
use crate::targets::Target;
use crate::watchdog::{Watchdog, computed};

/// What is wrong with the answer to an input.
#[derive(Debug)]
pub(crate) struct Finding(pub(crate) String);

/// An input that takes longer hangs.
const LONGEST: Duration = Duration::from_secs(20);
/// Time to make a failing input shorter.
const SHORTEN: Duration = Duration::from_secs(5);
/// Most inputs that are kept for their outcome.
const POOL: usize = 4000;

/// Counted memory and what happens at a panic are the process's: one input at a time.
static ALONE: Mutex<()> = Mutex::new(());
/// Where and why the last panic was.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// One target under fire.
pub(crate) struct Fuzzer {
    target: Box<dyn Target>,
    findings: PathBuf,
    scratch: tempfile::TempDir,
    watchdog: Watchdog,
    pool: Vec<Vec<u8>>,
    seeds: usize,
    outcomes: BTreeSet<String>,
    told: BTreeSet<String>,
    /// Inputs tried.
    pub(crate) tried: usize,
    /// The input that was computed at for longest, and how long.
    pub(crate) slowest: (Duration, Vec<u8>),
}

impl Fuzzer {
    /// `findings` is the folder for what is found.
    pub(crate) fn new(target: Box<dyn Target>, findings: PathBuf) -> Self {
        // In memory where that is possible: what is written is synchronised with the disk.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let scratch = tempfile::Builder::new().prefix("palpate-fuzz").tempdir_in(folder);
        let mut fuzzer = Self {
            target,
            findings,
            scratch: scratch.expect("a folder for temporary files"),
            watchdog: Watchdog::default(),
            pool: Vec::new(),
            seeds: 0,
            outcomes: BTreeSet::new(),
            told: BTreeSet::new(),
            tried: 0,
            slowest: (Duration::ZERO, Vec::new()),
        };
        fuzzer.pool = fuzzer.corpus();
        fuzzer.seeds = fuzzer.pool.len();
        fuzzer
    }

    /// The committed inputs, and those that the target makes.
    pub(crate) fn corpus(&self) -> Vec<Vec<u8>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(self.target.name());
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
            .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
            .unwrap_or_default();
        files.sort();
        let mut corpus: Vec<Vec<u8>> = files.iter().flat_map(std::fs::read).collect();
        corpus.extend(self.target.seeds());
        corpus
    }

    /// How many inputs were kept beside the corpus.
    pub(crate) fn kept(&self) -> usize {
        self.pool.len() - self.seeds
    }

    /// Tries one input; the outcome in words, without numbers.
    pub(crate) fn try_input(&mut self, input: &[u8]) -> Result<String, Finding> {
        let file = self.findings.join(format!("{}-hang", self.target.name()));
        self.watchdog.begin(input, LONGEST, file);
        let (target, scratch) = (&self.target, self.scratch.path());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let hook = panic::take_hook();
        panic::set_hook(Box::new(|info| {
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            let payload = info.payload();
            let text = payload.downcast_ref::<String>().map(String::as_str);
            let text = text.or(payload.downcast_ref::<&str>().copied()).unwrap_or_default();
            if let Ok(mut last) = PANIC.lock() {
                *last = format!("panic at {place}: {text}");
            }
        }));
        let (result, peak) =
            peak_of(|| panic::catch_unwind(AssertUnwindSafe(|| target.try_input(input, scratch))));
        panic::set_hook(hook);
        drop(alone);
        self.watchdog.end();
        let outcome = result
            .unwrap_or_else(|_| Err(PANIC.lock().map(|text| text.clone()).unwrap_or_default()));
        let warranted = 2 * self.target.warranted_memory(input.len());
        match outcome {
            Ok(_) if peak > warranted => Err(Finding(format!(
                "memory: {peak} bytes at once for an input of {}, more than {warranted}",
                input.len()
            ))),
            Ok(outcome) => Ok(without_numbers(&outcome)),
            Err(what) => Err(Finding(what)),
        }
    }

    /// Goes on for `time` or `count` inputs; returns how many different findings there were.
    pub(crate) fn go(
        &mut self,
        seed: u64,
        time: Duration,
        count: usize,
        tell: &mut dyn FnMut(&str),
    ) -> usize {
        let start = Instant::now();
        let mut random = Random(seed);
        let corpus = self.pool.clone();
        for input in corpus {
            self.look_at(&input, seed, tell);
        }
        while start.elapsed() < time && self.tried < count {
            let input = mutated(&self.pool, self.target.words(), &mut random);
            self.look_at(&input, seed, tell);
        }
        self.told.len()
    }

    fn look_at(&mut self, input: &[u8], seed: u64, tell: &mut dyn FnMut(&str)) {
        self.tried += 1;
        let start = computed();
        let outcome = self.try_input(input);
        let time = computed().saturating_sub(start);
        if time > self.slowest.0 {
            self.slowest = (time, input.to_vec());
        }
        match outcome {
            Ok(outcome) => {
                if self.outcomes.insert(outcome) && self.pool.len() < self.seeds + POOL {
                    self.pool.push(input.to_vec());
                }
            }
            Err(Finding(what)) => {
                let kind = without_numbers(&what);
                if self.told.insert(kind.clone()) {
                    let short = self.shortened(input, &kind);
                    let number = self.told.len();
                    let file =
                        self.findings.join(format!("{}-{seed}-{number}", self.target.name()));
                    let written = std::fs::create_dir_all(&self.findings)
                        .and_then(|()| std::fs::write(&file, short));
                    let place =
                        written.map_or_else(|e| e.to_string(), |()| file.display().to_string());
                    tell(&format!("seed {seed}, input {}: {what}\n  {place}", self.tried));
                }
            }
        }
    }

    /// The input without what does not matter to its finding.
    fn shortened(&mut self, input: &[u8], kind: &str) -> Vec<u8> {
        let start = Instant::now();
        let mut short = input.to_vec();
        let mut length = short.len().div_ceil(2);
        while length > 0 {
            let mut at = 0;
            while at < short.len() && start.elapsed() < SHORTEN {
                let end = (at + length).min(short.len());
                let tried = [&short[..at], &short[end..]].concat();
                match self.try_input(&tried) {
                    Err(Finding(what)) if without_numbers(&what) == kind => short = tried,
                    _ => at = end,
                }
            }
            length /= 2;
        }
        short
    }
}

/// Text with a mark for each number and quoted word: what tells kinds of outcomes apart.
fn without_numbers(text: &str) -> String {
    let mut result = String::new();
    let mut quoted = false;
    for c in text.chars().take(200) {
        if c == '`' || c == '\'' || c == '"' {
            quoted = !quoted;
        } else if !(quoted || c.is_ascii_digit() || "+-.".contains(c)) {
            result.push(c);
        }
    }
    result
}
