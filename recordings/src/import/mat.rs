//! MATLAB files of versions 5 to 7: arrays of numbers and structures of them.
//!
//! The format is published by MathWorks ("MAT-File Format"): a header of 128 bytes, then elements of a tag (type,
//! length) and data. Version 7 compresses each variable with zlib. Numbers may be stored in a smaller type than the
//! array's own. Every length is checked against the available bytes before anything is read or reserved.

use std::io::Read;

use flate2::read::ZlibDecoder;

use super::problem::ImportProblem;
use super::source::{Budget, Notation, Source, damaged, fault};
use crate::error::DataError;

const HEADER: usize = 128;
/// Largest nesting of structures.
const DEEPEST: usize = 8;

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

/// Whether the bytes start like a MATLAB file of version 5 or 7.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    order(bytes).is_some()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    Little,
    Big,
}

fn order(bytes: &[u8]) -> Option<Order> {
    match bytes.get(124..HEADER)? {
        [0, 1, b'I', b'M'] => Some(Order::Little),
        [1, 0, b'M', b'I'] => Some(Order::Big),
        _ => None,
    }
}

/// The variables of a file.
pub(super) fn variables(bytes: &[u8], budget: &mut Budget) -> Result<Source, DataError> {
    let order = order(bytes).ok_or_else(|| fault(ImportProblem::NoMatlab))?;
    let mut source = Source::new("MATLAB file");
    let mut rest = Elements {
        bytes: bytes.get(HEADER..).unwrap_or_default(),
        order,
    };
    while let Some(element) = rest.next()? {
        match element.kind {
            COMPRESSED => {
                let inner = unpacked(element.data, order, budget)?;
                let mut elements = Elements {
                    bytes: &inner,
                    order,
                };
                if let Some(element) = elements.next()?
                    && element.kind == MATRIX
                {
                    matrix(&mut source, budget, element.data, order, None, 0)?;
                }
                budget.give(inner.len() as u64);
            }
            MATRIX => matrix(&mut source, budget, element.data, order, None, 0)?,
            _ => {}
        }
    }
    Ok(source)
}

/// A compressed variable, decompressed. Its tag, which comes first, gives its length.
fn unpacked(packed: &[u8], order: Order, budget: &mut Budget) -> Result<Vec<u8>, DataError> {
    const TAG: usize = 8;
    let broken = |_| damaged("a packed variable cannot be unpacked");
    let mut decoder = ZlibDecoder::new(packed);
    let mut inner = Vec::with_capacity(TAG);
    (&mut decoder)
        .take(TAG as u64)
        .read_to_end(&mut inner)
        .map_err(broken)?;
    let stated =
        word(&inner, 4, order).ok_or_else(|| damaged("a packed variable cannot be unpacked"))?;
    let length = u64::from(stated).div_ceil(8) * 8;
    budget.take(TAG as u64 + length, || "a packed variable".to_owned())?;
    // A truncated file gives fewer bytes.
    decoder
        .take(length)
        .read_to_end(&mut inner)
        .map_err(broken)?;
    budget.give(TAG as u64 + length);
    budget.take(inner.len() as u64, || "a packed variable".to_owned())?;
    Ok(inner)
}

struct Element<'a> {
    kind: u32,
    data: &'a [u8],
}

/// Elements one after the other.
struct Elements<'a> {
    bytes: &'a [u8],
    order: Order,
}

impl<'a> Elements<'a> {
    fn next(&mut self) -> Result<Option<Element<'a>>, DataError> {
        if self.bytes.is_empty() {
            return Ok(None);
        }
        let short = || damaged("an element extends beyond the end of the file");
        let tag = word(self.bytes, 0, self.order).ok_or_else(short)?;
        let (kind, start, length) = if tag >> 16 != 0 {
            // In a small element, length, type and data are within eight bytes.
            (tag & 0xffff, 4, (tag >> 16) as usize)
        } else {
            let length = word(self.bytes, 4, self.order).ok_or_else(short)?;
            (tag, 8, length as usize)
        };
        if start == 4 && length > 4 {
            return Err(short());
        }
        let end = start + length;
        let data = self.bytes.get(start..end).ok_or_else(short)?;
        let next = match (start, kind) {
            (4, _) => 8,
            (_, COMPRESSED) => end,
            _ => end.div_ceil(8) * 8,
        };
        // The last element of a file need not be padded.
        self.bytes = self.bytes.get(next..).unwrap_or_default();
        Ok(Some(Element { kind, data }))
    }

    fn required(&mut self) -> Result<Element<'a>, DataError> {
        self.next()?.ok_or_else(|| damaged("an array ends early"))
    }
}

fn word(bytes: &[u8], at: usize, order: Order) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
    Some(match order {
        Order::Little => u32::from_le_bytes(four),
        Order::Big => u32::from_be_bytes(four),
    })
}

/// One array; `named` gives the name of a field.
fn matrix(
    source: &mut Source,
    budget: &mut Budget,
    data: &[u8],
    order: Order,
    named: Option<&str>,
    depth: usize,
) -> Result<(), DataError> {
    let mut parts = Elements { bytes: data, order };
    // An empty field is an array without bytes.
    let Some(flags) = parts.next()? else {
        return Ok(());
    };
    let flags = word(flags.data, 0, order).ok_or_else(|| damaged("array flags"))?;
    let (class, complex) = (flags & 0xff, flags & 0x0800 != 0);
    const OPAQUE: u32 = 17;
    if class == OPAQUE {
        let name = text(parts.required()?.data);
        let why = "an object (a table, timeseries, iddata or string); save the arrays inside it";
        skip(source, named.unwrap_or(&name), why);
        return Ok(());
    }
    let dimensions = parts.required()?;
    let shape: Vec<usize> = (0..dimensions.data.len() / 4)
        .filter_map(|i| word(dimensions.data, 4 * i, order))
        .map(|n| n as usize)
        .collect();
    let own_name = text(parts.required()?.data);
    let name = named.unwrap_or(&own_name);
    let count = shape
        .iter()
        .try_fold(1usize, |n, d| n.checked_mul(*d))
        .ok_or_else(|| damaged("array sizes"))?;
    if count == 0 {
        return Ok(());
    }
    match class {
        2 if count > 1 => skip(source, name, "an array of structures; save one of them"),
        2 if depth < DEEPEST => {
            let width = parts.required()?;
            let width = word(width.data, 0, order).unwrap_or(0) as usize;
            let names = parts.required()?;
            if width == 0 {
                return Err(damaged("field names"));
            }
            for field in names.data.chunks(width) {
                let element = parts.required()?;
                if element.kind == MATRIX {
                    let path = format!("{name}.{}", text(field));
                    matrix(source, budget, element.data, order, Some(&path), depth + 1)?;
                }
            }
        }
        2 => skip(source, name, "structures nested too deep"),
        1 => skip(source, name, "a cell array; save its arrays under names"),
        3 => skip(source, name, "an object; save the arrays inside it"),
        4 => skip(source, name, "text"),
        5 => skip(source, name, "a sparse array; save full(…) of it"),
        6..=15 if complex => skip(source, name, "complex; save real(…) or abs(…) of it"),
        6..=15 => {
            let stored = parts.required()?;
            let (size, number) =
                stored_as(stored.kind).ok_or_else(|| damaged("an unknown type of numbers"))?;
            if count.checked_mul(size) != Some(stored.data.len()) {
                return Err(damaged("an array has fewer numbers than its header states"));
            }
            budget.take_array(name, count)?;
            let rows = shape.first().copied().unwrap_or(1);
            let at = |row: usize, column: usize| -> f64 {
                let start = (column * rows + row) * size;
                let bytes = stored.data.get(start..start + size);
                bytes.map_or(f64::NAN, |b| number(b, order))
            };
            const SINGLE: u32 = 7;
            let exactness = if class == SINGLE {
                f64::from(f32::EPSILON)
            } else {
                f64::EPSILON
            };
            source.add(name, &shape, exactness, Notation::Matlab, &at);
        }
        _ => skip(source, name, "no array of numbers"),
    }
    Ok(())
}

fn skip(source: &mut Source, name: &str, why: &str) {
    // MATLAB stores data of objects in a variable without a name.
    if !name.is_empty() {
        source.skipped.push((name.to_owned(), why.to_owned()));
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(bytes.get(..end).unwrap_or_default()).into_owned()
}

type Number = fn(&[u8], Order) -> f64;

/// Size and reader of a stored type of numbers.
fn stored_as(kind: u32) -> Option<(usize, Number)> {
    macro_rules! reader {
        ($type:ty) => {
            (size_of::<$type>(), |bytes: &[u8], order: Order| {
                let Ok(bytes) = bytes.try_into() else {
                    return f64::NAN;
                };
                match order {
                    Order::Little => <$type>::from_le_bytes(bytes) as f64,
                    Order::Big => <$type>::from_be_bytes(bytes) as f64,
                }
            })
        };
    }
    let found: (usize, Number) = match kind {
        1 => reader!(i8),
        2 => reader!(u8),
        3 => reader!(i16),
        4 => reader!(u16),
        5 => reader!(i32),
        6 => reader!(u32),
        7 => reader!(f32),
        9 => reader!(f64),
        12 => reader!(i64),
        13 => reader!(u64),
        _ => return None,
    };
    Some(found)
}
