//! The body of every request, changed at random: whatever comes, the answer is a success or a problem of the client's
//! making. What sends them is the fuzz target's, `fuzz/src/bodies.rs`; here they are changed without looking at what
//! that leads to.

#[path = "../fuzz/src/bodies.rs"]
mod sender;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use chladni_base::SplitMix64;

/// What numbers and words are replaced by.
const ODD: [&str; 28] = [
    "0",
    "-1",
    "1",
    "2",
    "7",
    "41",
    "42",
    "59",
    "60",
    "79",
    "80",
    "1e308",
    "-1e-308",
    "0.5",
    "1e400",
    "4294967296",
    "18446744073709551616",
    "null",
    "true",
    "\"\"",
    "\"x\"",
    "[]",
    "{}",
    "[[]]",
    "[0,0]",
    "\"@0\"",
    "\"coordinates\"",
    "\"hsim\"",
];

/// Without an input that is answered: what decompression reads, only compression writes.
const REFUSED: [&str; 1] = ["POST /v1/bases/{id}/decompress"];

/// Where the words of a JSON text begin and end.
fn words(text: &[u8]) -> Vec<(usize, usize)> {
    let part = |byte: u8| byte.is_ascii_alphanumeric() || b"+-._@\"".contains(&byte);
    let mut words = Vec::new();
    let mut begin = None;
    for (at, &byte) in text.iter().chain(b" ").enumerate() {
        match (part(byte), begin) {
            (true, None) => begin = Some(at),
            (false, Some(from)) => {
                words.push((from, at));
                begin = None;
            }
            _ => {}
        }
    }
    words
}

/// Changes an input in one way or another; the first four bytes are where it goes.
fn change(input: &mut Vec<u8>, others: &[(String, Vec<u8>)], random: &mut SplitMix64) {
    let head = 4.min(input.len());
    let body = input.split_off(head);
    let words = words(&body);
    let mut out = body.clone();
    match random.below(8) {
        // One that was made for another kind of basis, or operation.
        0 => input[random.below(3)] = random.below(256) as u8,
        1..=3 if !words.is_empty() => {
            let (from, to) = words[random.below(words.len())];
            out.splice(from..to, ODD[random.below(ODD.len())].bytes());
        }
        // The word of another input.
        4 if !words.is_empty() => {
            let other = &others[random.below(others.len())].1[4..];
            let all = self::words(other);
            if !all.is_empty() {
                let ((from, to), (begin, end)) = (words[random.below(words.len())], all[random.below(all.len())]);
                out.splice(from..to, other[begin..end].iter().copied());
            }
        }
        5 => {
            let at = random.below(out.len() + 1);
            out.truncate(at);
        }
        6 if !out.is_empty() => {
            let at = random.below(out.len());
            out[at] = random.below(256) as u8;
        }
        _ => {
            let from = random.below(out.len() + 1);
            let to = (from + random.below(40)).min(out.len());
            let piece = out[from..to].to_vec();
            let at = random.below(out.len() + 1);
            out.splice(at..at, piece);
        }
    }
    input.extend(out);
}

/// Sends so many requests, or for so long; the number sent.
fn send(seed: u64, most: usize, time: Duration) -> usize {
    let seeds = sender::seeds();
    // Inputs that were refused for another reason before would show nothing.
    let mut answered: BTreeMap<String, bool> = BTreeMap::new();
    for (operation, status) in seeds.iter().filter_map(|(_, input)| sender::send_body(input)) {
        *answered.entry(operation).or_default() |= status.is_success();
    }
    let refused: Vec<&str> = answered.iter().filter(|(_, done)| !**done).map(|(name, _)| name.as_str()).collect();
    assert_eq!(refused, REFUSED, "no input for them is answered");
    let (mut random, begun, mut sent) = (SplitMix64::new(seed), Instant::now(), seeds.len());
    while sent < most && begun.elapsed() < time {
        let mut input = seeds[random.below(seeds.len())].1.clone();
        for _ in 0..1 + random.below(4) {
            change(&mut input, &seeds, &mut random);
        }
        let sending = Instant::now();
        let text = String::from_utf8_lossy(&input).into_owned();
        if let Err(panic) = std::panic::catch_unwind(|| drop(sender::send_body(&input))) {
            eprintln!("the input was {text:?}");
            std::panic::resume_unwind(panic);
        }
        if sending.elapsed() > Duration::from_secs(10) {
            println!("{:.1} s: {text:?}", sending.elapsed().as_secs_f64());
        }
        sent += 1;
    }
    sent
}

#[test]
fn no_body_is_a_fault_of_the_server() {
    send(1, 2000, Duration::MAX);
}

/// `STORM=600 cargo test --release --test bodies -- --ignored --nocapture`: for so many seconds, 60 unless told
/// otherwise.
#[test]
#[ignore = "takes a minute or more: the figures of docs/reliability.md"]
fn storm_of_bodies() {
    let seconds = std::env::var("STORM").map_or(60, |text| text.parse().unwrap());
    println!("{} requests", send(2, usize::MAX, Duration::from_secs(seconds)));
}
