//! FNV-1a, 64 bit: generated files check themselves with it when they are compiled.

/// What to begin with.
pub const START: u64 = 0xcbf2_9ce4_8422_2325;

/// Takes in a byte.
pub const fn over_byte(hash: u64, byte: u8) -> u64 {
    (hash ^ byte as u64).wrapping_mul(0x0000_0100_0000_01b3)
}

/// Takes in the bytes of a text.
pub const fn over_text(mut hash: u64, text: &str) -> u64 {
    let bytes = text.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        hash = over_byte(hash, bytes[i]);
        i += 1;
    }
    hash
}

/// Takes in the bytes of numbers, each from its lowest.
pub const fn over_numbers(mut hash: u64, values: &[f64]) -> u64 {
    let mut i = 0;
    while i < values.len() {
        let bytes = values[i].to_bits().to_le_bytes();
        let mut b = 0;
        while b < 8 {
            hash = over_byte(hash, bytes[b]);
            b += 1;
        }
        i += 1;
    }
    hash
}
