//! Zip archives made by hand, entry by entry, which may lie about what they hold.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use super::bundle::zipped;

/// An entry of an archive made by hand, which may lie.
#[derive(Clone)]
pub struct Raw {
    pub name: Vec<u8>,
    pub packed: Vec<u8>,
    pub size: u32,
    pub crc: u32,
    pub method: u16,
    pub flags: u16,
    pub mode: u32,
    /// Its offset as the directory tells it, instead of the true one.
    pub start: Option<u32>,
}

impl Raw {
    pub fn stored(name: &str, bytes: &[u8]) -> Self {
        let crc = crc32(bytes);
        let (name, packed, size) = (name.into(), bytes.to_vec(), bytes.len() as u32);
        Self { name, packed, size, crc, method: 0, flags: 0, mode: 0o100_644, start: None }
    }

    /// Deflated as an honest archiver does it.
    pub fn deflated(name: &str, bytes: &[u8]) -> Self {
        let archive = zipped(&[("x", bytes)]);
        let length = u32::from_le_bytes(archive[18..22].try_into().unwrap()) as usize;
        let start = 30 + 1 + usize::from(u16::from_le_bytes([archive[28], archive[29]]));
        let packed = archive[start..start + length].to_vec();
        let crc = u32::from_le_bytes(archive[14..18].try_into().unwrap());
        Self { packed, crc, size: bytes.len() as u32, method: 8, ..Self::stored(name, b"") }
    }
}

pub fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, &byte: &u8| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    };
    !bytes.iter().fold(!0, step)
}

/// An archive of such entries, whose end says that there are `count`.
pub fn archive(entries: &[Raw], count: u16) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for raw in entries {
        let start = raw.start.unwrap_or(out.len() as u32);
        let common = |out: &mut Vec<u8>| {
            for v in [20, raw.flags, raw.method, 0, 0x21] {
                out.extend(v.to_le_bytes());
            }
            for v in [raw.crc, raw.packed.len() as u32, raw.size] {
                out.extend(v.to_le_bytes());
            }
            out.extend((raw.name.len() as u16).to_le_bytes());
            out.extend([0, 0]);
        };
        if raw.start.is_none() {
            out.extend(b"PK\x03\x04");
            common(&mut out);
            out.extend(&raw.name);
            out.extend(&raw.packed);
        }
        directory.extend(b"PK\x01\x02\x14\x03");
        common(&mut directory);
        directory.extend([0; 6]);
        directory.extend((raw.mode << 16).to_le_bytes());
        directory.extend(start.to_le_bytes());
        directory.extend(&raw.name);
    }
    let start = out.len() as u32;
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend(count.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}
