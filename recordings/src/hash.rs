//! The content hash of a data set, which a model file states as its provenance.
//!
//! FNV-1a, 64 bits, over the sampling period and the records. Each record contributes its name, its use, t0, and
//! every column's name and values as IEEE 754 bits (little-endian), each string and column preceded by its length.
//! If stated, the command before the record and its lead contribute too. The title does not contribute. The hash
//! distinguishes data sets; it does not protect against deliberate collisions.

use crate::record::{Record, Use};

const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a, 64 bits.
#[derive(Debug, Clone, Copy)]
struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(PRIME);
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }

    fn number(&mut self, value: f64) {
        self.bytes(&value.to_bits().to_le_bytes());
    }
}

/// The hash as 16 hexadecimal digits.
pub(crate) fn of(sample_period_s: f64, records: &[Record]) -> String {
    let mut hash = Fnv(OFFSET);
    hash.number(sample_period_s);
    for record in records {
        hash.text(&record.name);
        hash.bytes(&[match record.role {
            Use::Identify => 0,
            Use::Validate => 1,
        }]);
        hash.number(record.t0);
        for (name, values) in record.columns() {
            hash.text(name);
            hash.bytes(&(values.len() as u64).to_le_bytes());
            values.iter().for_each(|&v| hash.number(v));
        }
        if let Some(before) = record.u_before {
            hash.text("u_before");
            hash.number(before);
        }
        if record.lead > 0 {
            hash.text("lead_samples");
            hash.bytes(&(record.lead as u64).to_le_bytes());
        }
    }
    format!("{:016x}", hash.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fnv_1a_reference_values() {
        // http://www.isthe.com/chongo/tech/comp/fnv: 64-bit FNV-1a of "", "a", "foobar".
        for (text, expected) in [
            ("", OFFSET),
            ("a", 0xaf63_dc4c_8601_ec8c),
            ("foobar", 0x8594_4171_f739_67e8),
        ] {
            let mut hash = Fnv(OFFSET);
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, expected);
        }
    }

    #[test]
    fn any_change_of_content_changes_the_hash() {
        let base = Record::new("a", Use::Identify, 0.001, vec![0.0, 1.0], vec![0.0, 0.5]);
        let reference = of(0.001, std::slice::from_ref(&base));
        assert_eq!(reference.len(), 16);
        assert_eq!(reference, of(0.001, std::slice::from_ref(&base.clone())));
        let changes: [fn(&mut Record); 8] = [
            |r| r.name.push('b'),
            |r| r.role = Use::Validate,
            |r| r.t0 = 0.5,
            |r| r.u_before = Some(0.0),
            |r| r.lead = 1,
            |r| r.y[1] = 0.500_000_000_000_000_1,
            |r| r.y_sd = Some(vec![0.0, 0.0]),
            |r| std::mem::swap(&mut r.u, &mut r.y),
        ];
        for change in changes {
            let mut other = base.clone();
            change(&mut other);
            assert_ne!(reference, of(0.001, &[other]));
        }
        assert_ne!(reference, of(0.002, &[base]));
    }
}
