//! Seeds of every fuzz target, cut off at every byte (those of the pipeline at every seventh) and
//! changed at random: none may panic or allocate much. Prints how long the slowest answer took, and
//! what stays in memory.
//!
//!     cargo test --test suite hostile::cut -- --nocapture
//!     MESHSNAP_HOSTILE=100000 cargo test --release --test suite hostile::cut -- --nocapture     as many for each target
//!
//! With `MESHSNAP_HOSTILE`, it also asserts that resident memory grows by at most a twentieth.
//! Other tests that run beside it in the process can raise that figure.

use crate::hostile::fuzzed::{files, root, targets};
use crate::support::files::mesh::Noise;
use crate::support::work::allocated_bytes;
use std::time::{Duration, Instant};

/// Changes of a target's seeds, unless `MESHSNAP_HOSTILE` sets another number.
const CHANGES: u64 = 2000;
/// The factor by which a target has fewer changes if its inputs are drawn.
const SLOWER_PIPELINE: u64 = 20;
/// The most that a small file may allocate on its thread, bytes.
const ANSWER_MAX_BYTES: u64 = 512 << 20;

#[test]
fn cut_and_changed_files_are_answered_in_memory() {
    let asked = std::env::var("MESHSNAP_HOSTILE").ok();
    let changes = asked.as_ref().map_or(CHANGES, |text| text.parse().expect("MESHSNAP_HOSTILE is a number"));
    println!("target       cuts  changes   seconds   slowest       of                resident MB, before and after");
    let (began, mut done, mut executions) = (Instant::now(), 0, 0);
    for target in targets::targets() {
        let seeds = files(&root().join("fuzz/seeds").join(target));
        let changes = if target == "pipeline" { changes.div_ceil(SLOWER_PIPELINE) } else { changes };
        let mut watch =
            Watch { target, slowest: (Duration::ZERO, String::new()), costliest: (0, String::new()), runs: 0 };
        // Memory that stays from job to job, and in the allocator, is taken before the count
        // begins.
        change(&mut watch, &seeds, (changes / 10).clamp(20, 2000), 1);
        let (before, start) = (resident_bytes(), Instant::now());
        let warm = watch.runs;
        cut(&mut watch, &seeds);
        let cuts = watch.runs - warm;
        change(&mut watch, &seeds, changes, 2);
        let after = resident_bytes();
        let ((took, name), megabytes) = (&watch.slowest, |bytes: u64| bytes as f64 / 1e6);
        println!(
            "{target:<10} {cuts:>6} {changes:>8} {:>9.1} {took:>9.1?}       {name:<20} {:.1} {:.1}",
            start.elapsed().as_secs_f64(),
            megabytes(before),
            megabytes(after)
        );
        assert!(watch.costliest.0 <= ANSWER_MAX_BYTES, "{target}: {:?}", watch.costliest);
        assert_eq!(watch.runs - warm, cuts + changes);
        assert!(cuts > 20, "{target}: {cuts} cuts");
        if asked.is_some() {
            assert!(after <= before + before / 20, "{target}: {before} bytes grew to {after}");
        }
        (done, executions) = (done + 1, executions + watch.runs);
    }
    println!("{executions} executions of {done} targets in {:.0?}; none panicked", began.elapsed());
    assert_eq!(done, targets::targets().len());
}

/// Runs inputs and remembers the slowest, to be printed, and the one that allocated most.
struct Watch {
    target: &'static str,
    slowest: (Duration, String),
    costliest: (u64, String),
    runs: u64,
}

impl Watch {
    fn run(&mut self, name: &str, bytes: &[u8]) {
        let start = Instant::now();
        let ((), cost) = allocated_bytes(|| targets::run(self.target, bytes));
        let took = start.elapsed();
        if cost > self.costliest.0 {
            self.costliest = (cost, name.to_owned());
        }
        if took > self.slowest.0 {
            self.slowest = (took, name.to_owned());
        }
        self.runs += 1;
    }
}

/// Every seed's beginnings; of what draws, every seventh.
fn cut(watch: &mut Watch, seeds: &[(String, Vec<u8>)]) {
    let step = if watch.target == "pipeline" { 7 } else { 1 };
    for (name, bytes) in seeds {
        for end in (0..bytes.len()).step_by(step) {
            watch.run(name, &bytes[..end]);
        }
    }
}

/// Seeds with one to four changes: a byte or a bit set, a piece dropped, doubled or moved in from
/// another seed.
fn change(watch: &mut Watch, seeds: &[(String, Vec<u8>)], count: u64, noise: u64) {
    let mut noise = Noise(0x5EED_0000 + noise);
    for _ in 0..count {
        let mut below = |n: usize| (noise.next() >> 16) as usize % n.max(1);
        let (name, bytes) = &seeds[below(seeds.len())];
        let mut bytes = bytes.clone();
        for _ in 0..=below(4) {
            let at = below(bytes.len());
            let end = (at + 1 + below(16)).min(bytes.len());
            match below(6) {
                _ if bytes.is_empty() => bytes.push(below(256) as u8),
                0 => bytes[at] = below(256) as u8,
                1 => bytes[at] ^= 1 << below(8),
                2 => bytes[at] = [0, 0xFF, 0x7F, 0x80, b'9', b' '][below(6)],
                3 => drop(bytes.drain(at..end)),
                4 => {
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
                _ => {
                    let other = &seeds[below(seeds.len())].1;
                    let from = below(other.len());
                    let piece = other[from..(from + 1 + below(64)).min(other.len())].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        watch.run(name, &bytes);
    }
}

/// Resident memory of this process, bytes.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a line on resident memory");
    line.split_whitespace().next().and_then(|number| number.parse::<u64>().ok()).expect("a number") * 1024
}
