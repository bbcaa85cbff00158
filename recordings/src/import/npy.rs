//! NumPy's `.npy` and `.npz`: a header that is the text of a dictionary, then the numbers.
//!
//! Read here instead of by a crate: available crates contain a parser for all Python literals, but only three keys
//! are needed. The archive of an `.npz` is read by the crate `zip`.

use std::io::{Cursor, Read};
use std::path::Path;

use super::problem::ImportProblem;
use super::source::{Budget, Notation, Source, damaged, fault};
use crate::error::{DataError, printable};

/// The array of one `.npy`, named by the file.
pub(super) fn single(path: &Path, bytes: &[u8], budget: &mut Budget) -> Result<Source, DataError> {
    let mut source = Source::new("NumPy array");
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    array(&mut source, budget, &stem, bytes)?;
    Ok(source)
}

/// The arrays of an `.npz`.
pub(super) fn archive(bytes: &[u8], budget: &mut Budget) -> Result<Source, DataError> {
    let broken = || damaged("the archive cannot be unpacked");
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|_| broken())?;
    let mut source = Source::new("NumPy archive");
    let mut arrays = 0;
    for index in 0..archive.len() {
        let file = archive.by_index(index).map_err(|_| broken())?;
        let name = file.name().map_err(|_| broken())?;
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
            continue;
        };
        arrays += 1;
        let size = file.size();
        let what = || format!("`{}`", printable(&name));
        budget.take(size, what)?;
        let mut content = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
        // Reads at most the stated size.
        file.take(size)
            .read_to_end(&mut content)
            .map_err(|_| broken())?;
        array(&mut source, budget, &name, &content)?;
        budget.give(size);
    }
    if arrays == 0 {
        return Err(fault(ImportProblem::NoArrays));
    }
    Ok(source)
}

fn array(
    source: &mut Source,
    budget: &mut Budget,
    name: &str,
    bytes: &[u8],
) -> Result<(), DataError> {
    let broken = || damaged("the header of an array");
    let bad = |why: &str| (name.to_owned(), why.to_owned());
    let byte = |at: usize| bytes.get(at).copied().map(usize::from);
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(broken());
    }
    let (start, length) = match byte(6) {
        Some(1) => (10, byte(8).zip(byte(9)).map(|(a, b)| a | b << 8)),
        Some(2 | 3) => {
            let four: Option<[u8; 4]> = bytes.get(8..12).and_then(|b| b.try_into().ok());
            (12, four.map(|b| u32::from_le_bytes(b) as usize))
        }
        _ => return Err(broken()),
    };
    let end = length.and_then(|n| n.checked_add(start));
    let end = end.filter(|&e| e <= bytes.len()).ok_or_else(broken)?;
    let header = bytes.get(start..end).unwrap_or_default();
    let header = std::str::from_utf8(header).map_err(|_| broken())?;
    let data = bytes.get(end..).unwrap_or_default();

    let kind = value(header, "descr").ok_or_else(broken)?;
    let fortran = value(header, "fortran_order").ok_or_else(broken)?;
    let shape = value(header, "shape")
        .and_then(|text| text.strip_prefix('(')?.split_once(')'))
        .ok_or_else(broken)?;
    let sizes = shape.0.split(',').map(str::trim).filter(|t| !t.is_empty());
    let shape: Vec<usize> = sizes
        .map(str::parse)
        .collect::<Result<_, _>>()
        .map_err(|_| broken())?;
    if kind.starts_with('[') {
        let why = "an array of records; save its fields: numpy.savez(\"run.npz\", **{n: a[n] for n in a.dtype.names})";
        source.skipped.push(bad(why));
        return Ok(());
    }
    let quoted = kind.get(1..).unwrap_or_default().split(['\'', '"']).next();
    let Some((size, number)) = quoted.and_then(stored_as) else {
        let why = "not an array of real numbers of 8 to 64 bits; save a.astype(float)";
        source.skipped.push(bad(why));
        return Ok(());
    };
    let count = shape.iter().try_fold(1usize, |n, d| n.checked_mul(*d));
    let count = count.ok_or_else(broken)?;
    if count.checked_mul(size) != Some(data.len()) {
        return Err(damaged("an array has another size than its header states"));
    }
    if count == 0 {
        return Ok(());
    }
    budget.take_array(name, count)?;
    let at = |row: usize, column: usize| -> f64 {
        let index = match shape.as_slice() {
            [rows, _] if fortran.starts_with("True") => column * rows + row,
            [_, columns] => row * columns + column,
            // The array is a vector, as a row or as a column.
            _ => row + column,
        };
        let bytes = data.get(index * size..(index + 1) * size);
        bytes.map_or(f64::NAN, number)
    };
    let exactness = match quoted.is_some_and(|k| k.ends_with("f4")) {
        true => f64::from(f32::EPSILON),
        false => f64::EPSILON,
    };
    source.add(name, &shape, exactness, Notation::Numpy, &at);
    Ok(())
}

/// The text after `'key':` in the header.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let at = header
        .find(&format!("'{key}'"))
        .or_else(|| header.find(&format!("\"{key}\"")))?;
    let rest = header.get(at + key.len() + 2..)?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

type Number = fn(&[u8]) -> f64;

/// Size and reader of a type like `<f8`.
fn stored_as(kind: &str) -> Option<(usize, Number)> {
    macro_rules! reader {
        ($type:ty) => {{
            let size = size_of::<$type>();
            if kind.starts_with('>') {
                (size, |b: &[u8]| {
                    b.try_into()
                        .map_or(f64::NAN, |b| <$type>::from_be_bytes(b) as f64)
                })
            } else {
                (size, |b: &[u8]| {
                    b.try_into()
                        .map_or(f64::NAN, |b| <$type>::from_le_bytes(b) as f64)
                })
            }
        }};
    }
    let found: (usize, Number) = match kind.get(1..)? {
        "b1" | "u1" => reader!(u8),
        "i1" => reader!(i8),
        "i2" => reader!(i16),
        "u2" => reader!(u16),
        "i4" => reader!(i32),
        "u4" => reader!(u32),
        "i8" => reader!(i64),
        "u8" => reader!(u64),
        "f4" => reader!(f32),
        "f8" => reader!(f64),
        _ => return None,
    };
    Some(found)
}
