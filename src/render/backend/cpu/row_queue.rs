//! The queue of finished bands (ranges of pixel rows): it gives them to a [`RowSink`], such as an encoder, from the
//! top down, while other bands are still being drawn. It may leave the last bands over, which are then taken from the
//! finished picture.

use std::sync::{Mutex, PoisonError, TryLockError};

use super::context::RasterContext;
use crate::backend::DrawStage;
use crate::image::RowSink;

/// The bands of a picture that are finished, until the sink has them.
pub struct RowQueue<'s, 'a> {
    sink: Mutex<Next<'s>>,
    finished: Mutex<Vec<Option<&'a [u8]>>>,
}

/// The sink, and the band that it takes next.
struct Next<'s> {
    sink: &'s mut dyn RowSink,
    band: usize,
}

impl<'s, 'a> RowQueue<'s, 'a> {
    /// A queue without bands.
    pub fn new(sink: &'s mut dyn RowSink) -> Self {
        Self { sink: Mutex::new(Next { sink, band: 0 }), finished: Mutex::default() }
    }

    /// Adds a finished band. This thread gives the sink what comes next in order, unless another thread is doing
    /// that: no thread waits for the sink.
    pub fn push(&self, context: &RasterContext<'_>, band: usize, rgba: &'a [u8]) {
        let mut finished = self.finished.lock().unwrap_or_else(PoisonError::into_inner);
        if finished.len() <= band {
            finished.resize(band + 1, None);
        }
        finished[band] = Some(rgba);
        drop(finished);
        let mut lap = context.watch.begin();
        // A band that another thread has finished while this one gave up the sink is seen by the next look.
        while self.give_in_order() {}
        lap.end(DrawStage::EncodeRows);
    }

    /// Gives the sink the bands that come next and are finished. True if there were some.
    fn give_in_order(&self) -> bool {
        let mut next = match self.sink.try_lock() {
            Ok(next) => next,
            Err(TryLockError::Poisoned(next)) => next.into_inner(),
            Err(TryLockError::WouldBlock) => return false,
        };
        let first = next.band;
        while let Some(rgba) = self.take(next.band) {
            next.sink.write_rows(rgba);
            next.band += 1;
        }
        next.band > first
    }

    fn take(&self, band: usize) -> Option<&'a [u8]> {
        self.finished.lock().unwrap_or_else(PoisonError::into_inner).get_mut(band)?.take()
    }
}
