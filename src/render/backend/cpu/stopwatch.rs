//! A stopwatch for the stages of a picture that the CPU draws, for reports. One of its times has
//! another use: that of encoding rows is left out of the costs by which a back-end may be chosen.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::backend::draw_times::{DrawStage, DrawTimes};

/// The stages of a band, in order. Each thread runs them for its own bands.
const BAND_STAGES: [DrawStage; 6] = [
    DrawStage::Visibility,
    DrawStage::Shade,
    DrawStage::Mixed,
    DrawStage::Lines,
    DrawStage::Resolve,
    DrawStage::EncodeRows,
];

/// Time of each stage, summed over all threads, and the number of mixed pixels.
#[derive(Default)]
pub struct Stopwatch {
    mixed_pixels: AtomicU64,
    nanoseconds: [AtomicU64; DrawStage::ALL.len()],
}

impl Stopwatch {
    /// Counts mixed pixels.
    pub fn count_mixed(&self, pixels: usize) {
        self.mixed_pixels.fetch_add(pixels as u64, Ordering::Relaxed);
    }

    /// Begins a stage.
    pub fn begin(&self) -> Lap<'_> {
        Lap { watch: self, began: Instant::now() }
    }

    /// The stages' wall times. Threads run those of bands side by side: their sums share the wall
    /// time of all bands.
    pub fn times(&self, bands: Duration) -> DrawTimes {
        let of = |stage: DrawStage| Duration::from_nanos(self.nanoseconds[stage as usize].load(Ordering::Relaxed));
        let sum: Duration = BAND_STAGES.into_iter().map(of).sum();
        let wall_share = bands.as_secs_f64() / sum.as_secs_f64().max(1e-9);
        let mut times = DrawTimes::default();
        times.mixed_pixels = self.mixed_pixels.load(Ordering::Relaxed);
        for stage in DrawStage::ALL {
            let is_of_band = BAND_STAGES.contains(&stage);
            times.add(stage, if is_of_band { of(stage).mul_f64(wall_share) } else { of(stage) });
        }
        times
    }
}

/// A thread's way through the stages.
pub struct Lap<'a> {
    watch: &'a Stopwatch,
    began: Instant,
}

impl Lap<'_> {
    /// Ends a stage, and begins the next.
    pub fn end(&mut self, stage: DrawStage) {
        let nanoseconds = u64::try_from(self.restart().as_nanos()).unwrap_or(u64::MAX);
        self.watch.nanoseconds[stage as usize].fetch_add(nanoseconds, Ordering::Relaxed);
    }

    /// The time since the last stage ended. Begins the next.
    pub fn restart(&mut self) -> Duration {
        let now = Instant::now();
        now.duration_since(std::mem::replace(&mut self.began, now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_of_bands_share_their_wall_time() {
        let ms = |n: u64| AtomicU64::new(n * 1_000_000);
        let nanoseconds = [ms(3), ms(1), ms(0), ms(10), ms(0), ms(20), ms(0), ms(0), ms(10), ms(0)];
        let watch = Stopwatch { nanoseconds, mixed_pixels: AtomicU64::new(7) };
        let parts: Vec<_> = watch.times(Duration::from_millis(20)).parts().collect();
        let wanted = [
            (DrawStage::Transform, 3),
            (DrawStage::Sort, 1),
            (DrawStage::Visibility, 5),
            (DrawStage::Shade, 10),
            (DrawStage::Resolve, 5),
        ];
        assert_eq!(parts, wanted.map(|(stage, ms)| (stage, Duration::from_millis(ms))));
        assert_eq!(watch.times(Duration::ZERO).mixed_pixels, 7);
        assert_eq!(Stopwatch::default().times(Duration::ZERO).parts().count(), 0);
    }
}
