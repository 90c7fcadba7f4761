//! `palpate-fuzz TARGET SECONDS [SEED]` throws mutated inputs at a part of palpate for so long;
//! `palpate-fuzz TARGET --input FILE` tries one input again.
//!
//! What it finds (a panic, a hang, a wrong answer, too much memory) is made shorter, written below
//! `target/fuzz` and told with the seed; the exit status is then 1.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program that talks")]

mod choices;
mod mutate;
mod run;
mod shown;
mod targets;
mod watchdog;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use run::{Finding, Fuzzer};

#[global_allocator]
static ALLOCATOR: palpate_testing::Counting = palpate_testing::Counting;

const USAGE: &str = "palpate-fuzz TARGET SECONDS [SEED] | palpate-fuzz TARGET --input FILE";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (name, rest) = match words.as_slice() {
        [name, rest @ ..] if !rest.is_empty() => (*name, rest),
        _ => return usage(),
    };
    let Some(target) = targets::all().into_iter().find(|target| target.name() == name) else {
        return usage();
    };
    let findings = PathBuf::from("target/fuzz");
    if let ["--input", path] = rest {
        let Ok(input) = std::fs::read(path) else {
            eprintln!("{path} cannot be read");
            return ExitCode::FAILURE;
        };
        return match Fuzzer::new(target, findings).try_input(&input) {
            Ok(outcome) => {
                println!("fine: {outcome}");
                ExitCode::SUCCESS
            }
            Err(Finding(what)) => {
                println!("{what}");
                ExitCode::FAILURE
            }
        };
    }
    let Some(seconds) = rest[0].parse().ok().and_then(|it| Duration::try_from_secs_f64(it).ok())
    else {
        return usage();
    };
    let seed = match rest.get(1).map(|seed| seed.parse()) {
        None => {
            SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_millis() as u64)
        }
        Some(Ok(seed)) => seed,
        Some(Err(_)) => return usage(),
    };
    let mut fuzzer = Fuzzer::new(target, findings);
    let found = fuzzer.go(seed, seconds, usize::MAX, &mut |line| println!("{line}"));
    println!(
        "{name}: seed {seed}, {} inputs, {} of other outcomes kept, {found} findings; the slowest took {:.2} s",
        fuzzer.tried,
        fuzzer.kept(),
        fuzzer.slowest.0.as_secs_f64()
    );
    if let Ok(path) = std::env::var("PALPATE_FUZZ_SLOWEST") {
        std::fs::write(path, &fuzzer.slowest.1).ok();
    }
    if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn usage() -> ExitCode {
    let names: Vec<&str> = targets::all().iter().map(|target| target.name()).collect();
    eprintln!("{USAGE}\nTARGET is one of {}", names.join(", "));
    ExitCode::FAILURE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The committed corpus holds what was found once: none of it is found again.
    #[test]
    fn nothing_in_the_corpus_is_a_finding() {
        for target in targets::all() {
            let name = target.name();
            let mut fuzzer = Fuzzer::new(target, PathBuf::new());
            for (index, input) in fuzzer.corpus().into_iter().enumerate() {
                if let Err(Finding(what)) = fuzzer.try_input(&input) {
                    panic!("{name}, input {index} of the corpus: {what}");
                }
            }
        }
    }

    #[test]
    fn a_few_mutations_find_nothing() {
        for target in targets::all() {
            let name = target.name();
            let folder = tempfile::tempdir().expect("a folder for temporary files");
            let mut fuzzer = Fuzzer::new(target, folder.path().to_path_buf());
            let mut lines = Vec::new();
            let found =
                fuzzer.go(1, Duration::from_secs(60), 200, &mut |line| lines.push(line.to_owned()));
            assert_eq!(found, 0, "{name}: {lines:#?}");
        }
    }
}
