//! Lines: JSON, a star, and the CRC of the JSON.

/// CRC-32 of IEEE 802.3, as of zlib: finds every error of up to three bits in a line, and every burst of up to 32.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
        }
    }
    !crc
}

/// Bytes of star and CRC.
const SEAL: usize = 9;

fn digits(crc: u32) -> [u8; 8] {
    core::array::from_fn(|place| {
        let nibble = (crc >> (28 - 4 * place)) as u8 & 15;
        nibble + if nibble < 10 { b'0' } else { b'a' - 10 }
    })
}

/// The JSON of a line, with or without its line feed; `None` when its CRC is missing or another one.
pub fn opened(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let (json, seal) = line.split_at_checked(line.len().checked_sub(SEAL)?)?;
    (seal.strip_prefix(b"*")? == digits(crc32(json))).then_some(json)
}

/// The line of what is at the beginning of a buffer, with its line feed; `None` when the buffer is too short.
pub fn sealed(buffer: &mut [u8], length: usize) -> Option<&[u8]> {
    let crc = digits(crc32(buffer.get(..length)?));
    let seal = buffer.get_mut(length..)?.first_chunk_mut::<{ SEAL + 1 }>()?;
    let (star, rest) = seal.split_first_mut()?;
    let (line_feed, place) = rest.split_last_mut()?;
    (*star, *line_feed) = (b'*', b'\n');
    place.copy_from_slice(&crc);
    buffer.get(..length + SEAL + 1)
}
