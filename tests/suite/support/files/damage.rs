//! Files cut off anywhere and changed at random: no reader panics over them or allocates much.

use crate::support::files::mesh::{Noise, read_as};
use meshsnap_render::import::{Format, MeshFault};

use crate::support::work::{allocated_bytes, within_bytes};

/// Bytes that a damaged file of some kilobytes may allocate.
const COST_MAX: u64 = 256 << 20;

/// The same of FBX: its parser may ask for half of the job's budget at once, before it finds that the
/// packed bytes of an array are fewer than promised.
const FBX_COST_MAX: u64 = COST_MAX + (1 << 30);

/// Reads every beginning of `good`, sniffed and by its name. Gives how many of them are drawn.
pub fn cut_everywhere(good: &[u8], format: Format) -> usize {
    let (mut cases, mut drawn) = (0, 0);
    for length in 0..good.len() {
        for named in [None, Some(format)] {
            match within_bytes(COST_MAX, "a file cut off", || read_as(&good[..length], named)) {
                Ok(_) => drawn += 1,
                Err(error) => {
                    let typed = [
                        MeshFault::Unrecognised,
                        MeshFault::Broken,
                        MeshFault::BundleBroken,
                        MeshFault::Empty,
                        MeshFault::OutsideBundle,
                    ];
                    assert!(typed.contains(&error.fault), "{length}: {error}");
                    assert!(!error.detail.is_empty() && error.detail.len() < 1000, "{length}: {error}");
                }
            }
            cases += 1;
        }
    }
    assert_eq!(cases, 2 * good.len());
    drawn
}

/// Reads `rounds` files that are nearly `good`. Gives how many of them are drawn.
pub fn mutate(good: &[u8], format: Format, rounds: usize, seed: u64) -> usize {
    let mut noise = Noise(seed);
    let mut random = |below: usize| (noise.next() >> 33) as usize % below;
    let (mut drawn, mut refused, mut costliest) = (0, 0, 0);
    for _ in 0..rounds {
        let mut bytes = good.to_vec();
        for _ in 0..=random(4) {
            let at = random(bytes.len());
            match random(6) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] ^= 1 << random(8),
                2 if bytes.len() > 1 => _ = bytes.remove(at),
                3 => bytes.insert(at, b"0123456789-.e \nnaif\"/<>:{}"[random(26)]),
                // A piece of the file again, elsewhere.
                4 => {
                    let piece = bytes[at..(at + 1 + random(40)).min(bytes.len())].to_vec();
                    let place = random(bytes.len());
                    bytes.splice(place..place, piece).for_each(drop);
                }
                _ if random(8) == 0 => bytes.truncate(at.max(1)),
                _ => bytes[at] = [0, 0xff, 0x7f, 0x80][random(4)],
            }
        }
        let (result, cost) = allocated_bytes(|| read_as(&bytes, Some(format)));
        match result {
            Ok(_) => drawn += 1,
            Err(error) => {
                assert!(!error.detail.is_empty() && error.detail.len() < 2000, "{error}");
                refused += 1;
            }
        }
        costliest = costliest.max(cost);
    }
    println!("{rounds} mutations of {format}: {drawn} drawn, costliest {costliest} bytes");
    assert_eq!(drawn + refused, rounds);
    let allowed = if format == Format::Fbx { FBX_COST_MAX } else { COST_MAX };
    assert!(costliest <= allowed, "{costliest} bytes allocated");
    drawn
}
