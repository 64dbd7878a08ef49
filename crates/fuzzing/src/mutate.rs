//! Inputs made of valid ones: a function of target, seeds and number of the case, the same on every machine.

use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use rand::seq::IndexedRandom as _;

use crate::parts::BETWEEN;

/// Longest input, bytes.
pub const LONGEST: usize = 1 << 20;

/// Most changes of one input.
const MOST_CHANGES: u32 = 4;
/// Longest stretch that is removed, repeated or taken from another input, bytes.
const STRETCH: usize = 400;
/// One input in so many begins anew with something hostile instead of a seed.
const HOSTILE_SHARE: u32 = 40;
/// How deep nests are: a reader that calls itself for each level does not get there.
const DEEP: usize = 100_000;

/// What takes the place of numbers.
const NUMBERS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "Infinity",
    "null",
    "true",
    "127",
    "256",
    "65537",
    "1000000000",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "\"7\"",
];
/// What is put anywhere.
const SNIPPETS: [&str; 26] = [
    "\"",
    "'",
    "\"\"\"",
    "\\",
    "\\u0000",
    "\\n",
    "\r\n",
    "\n\n",
    "\0",
    "\u{feff}",
    "é",
    ",",
    ",,,,",
    "[",
    "]",
    "{",
    "}",
    "[[",
    "= {",
    "<",
    "</",
    "/>",
    "<!--",
    "&#10;",
    "#",
    "\"a\\nb\" = 1\n",
];
/// Little-endian lengths and counts.
const LENGTHS: [u64; 9] = [0, 1, 0x7f, 0xff, 0x7fff_ffff, 0xffff_ffff, 1_000_000_000, i64::MAX as u64, u64::MAX];

/// Case number `number` of a target: one of the seeds, changed.
///
/// # Panics
///
/// Without seeds.
#[must_use]
pub fn case(seeds: &[Vec<u8>], number: u64) -> Vec<u8> {
    let mut rng = Seed(0xf022).stream(Purpose::Test, number);
    let mut bytes = seeds[rng.random_range(0..seeds.len())].clone();
    if rng.random_range(0..HOSTILE_SHARE) == 0 {
        // In one of the files of an input, or in all of it.
        let between = bytes.windows(BETWEEN.len()).position(|window| window == BETWEEN);
        let whole = 0..bytes.len();
        let parts = between.map_or_else(|| vec![whole], |at| vec![0..at, at + BETWEEN.len()..bytes.len()]);
        let part = parts[rng.random_range(0..parts.len())].clone();
        bytes.splice(part, hostile(&mut rng));
    } else {
        // Mostly one: what is refused for the first change hides what the others would find.
        let changes = rng.random_range(1..=3 * MOST_CHANGES).saturating_sub(2 * MOST_CHANGES).max(1);
        for _ in 0..changes {
            change(&mut bytes, seeds, &mut rng);
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut Rng) {
    if bytes.is_empty() {
        bytes.extend(snippet(rng));
        return;
    }
    match rng.random_range(0..20) {
        0 => {
            let at = place(bytes, rng);
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
        1 => {
            let at = place(bytes, rng);
            bytes[at] = rng.random();
        }
        2 => bytes.truncate(place(bytes, rng)),
        3 => {
            bytes.drain(stretch(bytes, rng));
        }
        4 => {
            let copied = bytes[stretch(bytes, rng)].to_vec();
            let (at, times) = (place(bytes, rng), *[1, 2, 50].choose(rng).unwrap_or(&1));
            bytes.splice(at..at, copied.repeat(times));
        }
        5 => {
            let other = &seeds[rng.random_range(0..seeds.len())];
            if !other.is_empty() {
                let taken = other[stretch(other, rng)].to_vec();
                bytes.splice(stretch(bytes, rng), taken);
            }
        }
        6 => {
            let other = &seeds[rng.random_range(0..seeds.len())];
            bytes.truncate(place(bytes, rng));
            bytes.extend(&other[rng.random_range(0..=other.len())..]);
        }
        7 => {
            let at = place(bytes, rng);
            bytes.splice(at..at, snippet(rng));
        }
        8 => {
            let (at, width) = (place(bytes, rng), *[1, 2, 4, 8].choose(rng).unwrap_or(&4));
            let value = LENGTHS.choose(rng).unwrap_or(&0).to_le_bytes();
            for (byte, new) in bytes[at..].iter_mut().zip(&value[..width]) {
                *byte = *new;
            }
        }
        9..=14 => replace(bytes, rng, |b| b.is_ascii_digit() || b"+-.eE".contains(&b), |rng| text(&NUMBERS, rng)),
        15 => replace(bytes, rng, |b| b.is_ascii_alphanumeric() || b == b'_', word),
        16 => lines(bytes, rng, |lines, rng| {
            lines.remove(rng.random_range(0..lines.len()));
        }),
        17 => lines(bytes, rng, |lines, rng| {
            let (from, to) = (rng.random_range(0..lines.len()), rng.random_range(0..lines.len()));
            let copy = lines[from].clone();
            lines.insert(to, copy);
        }),
        18 => lines(bytes, rng, |lines, rng| {
            let (a, b) = (rng.random_range(0..lines.len()), rng.random_range(0..lines.len()));
            lines.swap(a, b);
        }),
        _ => {
            let (open, count) = (*[&b"["[..], b"{\"a\":", b"(", b"<a>"].choose(rng).unwrap_or(&&b"["[..]), 200);
            let at = place(bytes, rng);
            bytes.splice(at..at, open.repeat(count));
        }
    }
}

/// What no seed leads to: depth, size, other alphabets, nothing.
fn hostile(rng: &mut Rng) -> Vec<u8> {
    match rng.random_range(0..12) {
        0 => Vec::new(),
        1 => b"a = ".iter().copied().chain(b"[".repeat(DEEP)).collect(),
        2 => b"a = ".iter().copied().chain(b"{a=".repeat(DEEP)).collect(),
        3 => b"a.".repeat(DEEP).into_iter().chain(*b"a = 1\n").collect(),
        4 => b"[".iter().copied().chain(b"a.".repeat(DEEP)).chain(*b"a]\n").collect(),
        5 => b"[".repeat(DEEP),
        6 => b"{\"hello\":".repeat(DEEP),
        7 => b"<robot name=\"a\">".iter().copied().chain(b"<link name=\"a\">".repeat(DEEP / 4)).collect(),
        8 => (0..rng.random_range(1..5000)).map(|_| rng.random()).collect(),
        9 => vec![b'9'; LONGEST],
        10 => vec![0xff; 3000],
        _ => b"PAR1".iter().copied().chain([0xff; 200]).chain(*b"\xc8\0\0\0PAR1").collect(),
    }
}

fn place(bytes: &[u8], rng: &mut Rng) -> usize {
    rng.random_range(0..bytes.len().max(1))
}

fn stretch(bytes: &[u8], rng: &mut Rng) -> std::ops::Range<usize> {
    let at = place(bytes, rng);
    at..(at + rng.random_range(1..STRETCH)).min(bytes.len())
}

fn text(of: &[&str], rng: &mut Rng) -> Vec<u8> {
    of.choose(rng).map(|text| text.as_bytes().to_vec()).unwrap_or_default()
}

fn snippet(rng: &mut Rng) -> Vec<u8> {
    match rng.random_range(0..4) {
        0 => (0..rng.random_range(1..20)).map(|_| rng.random()).collect(),
        1 => text(&NUMBERS, rng),
        _ => text(&SNIPPETS, rng),
    }
}

fn word(rng: &mut Rng) -> Vec<u8> {
    match rng.random_range(0..4) {
        0 => b"a".repeat(20_000),
        1 => Vec::new(),
        2 => "zwölf\\u0007".as_bytes().to_vec(),
        _ => text(&["box", "none", "mesh", "F64", "version", "name", "effects"], rng),
    }
}

/// Replaces the run of bytes of a kind that is the next one after a place.
fn replace(bytes: &mut Vec<u8>, rng: &mut Rng, kind: fn(u8) -> bool, with: fn(&mut Rng) -> Vec<u8>) {
    let at = place(bytes, rng);
    let Some(skipped) = bytes[at..].iter().position(|b| kind(*b)) else { return };
    let start = at + skipped;
    let back = bytes[..start].iter().rev().take_while(|b| kind(**b)).count();
    let length = bytes[start..].iter().take_while(|b| kind(**b)).count();
    let new = with(rng);
    bytes.splice(start - back..start + length, new);
}

fn lines(bytes: &mut Vec<u8>, rng: &mut Rng, change: fn(&mut Vec<Vec<u8>>, &mut Rng)) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    change(&mut lines, rng);
    *bytes = lines.join(&b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_are_the_same_each_time_differ_and_are_bounded() {
        let seeds = [b"[task]\nhorizon = 40\n".to_vec(), b"{\"act\": {\"step\": 1}}".to_vec()];
        let all: Vec<Vec<u8>> = (0..300).map(|number| case(&seeds, number)).collect();
        assert_eq!(case(&seeds, 7), all[7]);
        assert!(all.iter().all(|bytes| bytes.len() <= LONGEST));
        let distinct: std::collections::BTreeSet<_> = all.iter().collect();
        assert!(distinct.len() > 200, "{}", distinct.len());
    }
}
