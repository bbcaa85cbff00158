//! Decodes the load or store that the core is about to execute. At a watchpoint the program counter points to it,
//! and its bytes determine the register.

/// A load or store of one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Access {
    /// True for a load: from memory to the register.
    pub(super) load: bool,
    /// Bytes, 1, 2 or 4.
    pub(super) size: u8,
    /// The register.
    pub(super) register: u8,
}

/// Decoded from the four bytes at the program counter.
pub(super) fn access(code: [u8; 4]) -> Option<Access> {
    let [a, b, c, d] = code;
    let (first, second) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
    // These are the first bits of a 32-bit instruction (ARMv7-M, A5.1).
    if first >> 11 >= 0b11101 {
        long(first, second)
    } else {
        short(first)
    }
}

fn long(first: u16, second: u16) -> Option<Access> {
    // LDR, STR and their narrow forms, with all addressing modes (A5.3.7 to A5.3.10). Signed loads need no
    // distinction, since no register of the chip is signed.
    let size = match (first >> 9, first >> 5 & 3) {
        (0b111_1100, 0) => 1,
        (0b111_1100, 1) => 2,
        (0b111_1100, 2) => 4,
        _ => return None,
    };
    Some(Access {
        load: first >> 4 & 1 == 1,
        size,
        register: (second >> 12) as u8,
    })
}

fn short(code: u16) -> Option<Access> {
    let register = (code & 7) as u8;
    let (load, size) = match code >> 11 {
        0b01100 => (false, 4),
        0b01101 => (true, 4),
        0b01110 => (false, 1),
        0b01111 => (true, 1),
        0b10000 => (false, 2),
        0b10001 => (true, 2),
        // The index is in a register.
        0b01010 | 0b01011 => match code >> 9 & 7 {
            0 => (false, 4),
            1 => (false, 2),
            2 => (false, 1),
            4 => (true, 4),
            3 | 6 => (true, 1),
            _ => (true, 2),
        },
        _ => return None,
    };
    Some(Access {
        load,
        size,
        register,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings as an assembler gives them.
    #[test]
    fn loads_and_stores_are_read_from_their_bytes() {
        let found = |first: u16, second: u16| {
            let ([a, b], [c, d]) = (first.to_le_bytes(), second.to_le_bytes());
            access([a, b, c, d]).map(|x| (x.load, x.size, x.register))
        };
        // ldr r0, [r1, #8]
        assert_eq!(found(0x6888, 0xbf00), Some((true, 4, 0)));
        // str r2, [r3]
        assert_eq!(found(0x601a, 0xbf00), Some((false, 4, 2)));
        // strb r1, [r0]
        assert_eq!(found(0x7001, 0xbf00), Some((false, 1, 1)));
        // str r3, [r1, r2]
        assert_eq!(found(0x508b, 0xbf00), Some((false, 4, 3)));
        // str.w r12, [r0, #24]
        assert_eq!(found(0xf8c0, 0xc018), Some((false, 4, 12)));
        // ldr.w r8, [r0, r1, lsl #2]
        assert_eq!(found(0xf850, 0x8021), Some((true, 4, 8)));
        // ldr r4, [r5, #4]! and strh.w r9, [r1, #2]
        assert_eq!(found(0xf855, 0x4f04), Some((true, 4, 4)));
        assert_eq!(found(0xf8a1, 0x9002), Some((false, 2, 9)));
        // adds r0, #1
        assert_eq!(found(0x3001, 0xf8c0), None);
    }
}
