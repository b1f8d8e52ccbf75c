//! The decompression, in another process, of buffer views that meshoptimizer has packed: a hostile
//! file that makes the decoder crash there does no harm here. One order can have many views,
//! because each order costs a process.

use super::meshopt::{DECODER, Packed, Unpacked, unpack};
use crate::guard::{Panicked, guarded};
use crate::import::context::Context;
use crate::import::isolate::{self, Isolation, Order};
use crate::import::{MeshError, MeshFault};

/// Most unpacked bytes of views that are unpacked before they are asked for.
pub const AHEAD_BYTES_MAX: u64 = 64 << 20;
/// Memory beside the views, bytes.
const BESIDE_BYTES: u64 = 1 << 20;

/// One view: what it holds, and how many bytes of the file are its own.
type Part = (Packed, u64);

/// [`Unpacked`] as it is sent.
type Answer = Result<Option<Vec<u8>>, ()>;

/// Unpacks views in the other process.
pub fn read(
    views: &[(Packed, &[u8])],
    isolation: &dyn Isolation,
    cx: &Context<'_>,
) -> Result<Vec<Unpacked>, MeshError> {
    let parts: Vec<Part> = views.iter().map(|(packed, bytes)| (*packed, bytes.len() as u64)).collect();
    let foul = || MeshError::new(MeshFault::DecoderCrashed, "the decoder of this format answered with nonsense");
    let mut head = vec![isolate::MESHOPT];
    head.extend(postcard::to_stdvec(&parts).map_err(|_| foul())?);
    let file = views.iter().map(|(_, bytes)| *bytes).collect::<Vec<_>>().concat();
    let unpacked_bytes = views.iter().map(|(packed, _)| packed.bytes()).fold(0, u64::saturating_add);
    let memory_bytes = unpacked_bytes.saturating_mul(3).saturating_add(BESIDE_BYTES);
    let lend = |bytes| cx.budget.lend_beside(bytes);
    let answer = isolation.decode(&Order { head: &head, file: &file, memory_bytes, lend: &lend }, cx.deadline)?;
    let all: Vec<Answer> = postcard::from_bytes(&answer).map_err(|_| foul())?;
    let fits = |one: &Answer, packed: &Packed| match one {
        Ok(Some(bytes)) => bytes.len() as u64 == packed.bytes(),
        _ => true,
    };
    if all.len() != views.len() || !all.iter().zip(views).all(|(one, (packed, _))| fits(one, packed)) {
        return Err(foul());
    }
    Ok(all.into_iter().map(|one| one.map_err(|()| Panicked(DECODER))).collect())
}

/// What the other process does with an order.
pub fn answer(head: &[u8], file: &[u8]) -> Vec<u8> {
    let parts: Vec<Part> = postcard::from_bytes(head).unwrap_or_default();
    let mut rest = file;
    let mut all: Vec<Answer> = Vec::with_capacity(parts.len());
    for (packed, packed_bytes) in parts {
        let (bytes, after) = rest.split_at_checked(packed_bytes as usize).unwrap_or((rest, &[]));
        rest = after;
        all.push(guarded(DECODER, || unpack(packed, bytes)).map_err(drop));
    }
    postcard::to_stdvec(&all).unwrap_or_default()
}
