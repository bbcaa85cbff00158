//! Small changes of bytes, of numbers in text, and of words.

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

/// Numbers that often cause failures.
const NUMBERS: &[&str] = &[
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551616",
    "1e-320",
    "1e-300",
    "1e300",
    "-1e300",
    "1e18",
    "inf",
    "-inf",
    "nan",
    "0.001",
    "1e9",
    "",
];

/// A mutated copy of `input`; may contain parts of `other` and `words`.
pub(super) fn mutated(
    mut input: Vec<u8>,
    other: &[u8],
    words: &[&str],
    random: &mut ChaCha8Rng,
) -> Vec<u8> {
    for _ in 0..random.random_range(1..=5) {
        change(&mut input, other, words, random);
    }
    input
}

fn change(input: &mut Vec<u8>, other: &[u8], words: &[&str], random: &mut ChaCha8Rng) {
    let at = random.random_range(0..=input.len());
    let span = |random: &mut ChaCha8Rng, length: usize| {
        let from = random.random_range(0..=length);
        let most = (length - from).min(if random.random_bool(0.2) { length } else { 24 });
        from..from + random.random_range(0..=most)
    };
    match random.random_range(0..11) {
        0 | 1 => {
            if let Some(byte) = input.get_mut(at) {
                *byte ^= 1 << random.random_range(0..8);
            }
        }
        2 => {
            if let Some(byte) = input.get_mut(at) {
                *byte = random.next_u32() as u8;
            }
        }
        3 => {
            let range = span(random, input.len());
            input.drain(range);
        }
        4 => {
            let part = input[span(random, input.len())].to_vec();
            input.splice(at..at, part);
        }
        5 => {
            let part = other[span(random, other.len())].to_vec();
            let to = (at + part.len()).min(input.len());
            let end = if random.random_bool(0.5) { at } else { to };
            input.splice(at..end, part);
        }
        6 | 7 => number(input, at, random),
        8 => {
            let line_of = |text: &[u8]| -> Vec<Vec<u8>> {
                text.split_inclusive(|b| *b == b'\n')
                    .map(<[u8]>::to_vec)
                    .collect()
            };
            let mut lines = line_of(input);
            if lines.len() > 1 {
                let (a, b) = (
                    random.random_range(0..lines.len()),
                    random.random_range(0..lines.len()),
                );
                match random.random_range(0..3) {
                    0 => lines.swap(a, b),
                    1 => lines.insert(a, lines[b].clone()),
                    _ => drop(lines.remove(a)),
                }
                *input = lines.concat();
            }
        }
        9 => input.truncate(at),
        _ => {
            if !words.is_empty() {
                let word = words[random.random_range(0..words.len())]
                    .as_bytes()
                    .to_vec();
                input.splice(at..at, word);
            }
        }
    }
}

/// Replaces a nearby number by one of [`NUMBERS`].
fn number(input: &mut Vec<u8>, at: usize, random: &mut ChaCha8Rng) {
    let is_part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E');
    let Some(from) = input
        .iter()
        .skip(at)
        .position(u8::is_ascii_digit)
        .map(|n| n + at)
    else {
        return;
    };
    let from = (0..from)
        .rev()
        .find(|&i| !is_part(&input[i]))
        .map_or(0, |i| i + 1);
    let to = (from..input.len())
        .find(|&i| !is_part(&input[i]))
        .unwrap_or(input.len());
    let text = NUMBERS[random.random_range(0..NUMBERS.len())];
    input.splice(from..to, text.bytes());
}
