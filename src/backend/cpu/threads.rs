//! The threads that the renderers of a process share.
//!
//! A picture that is drawn alone has them all. Of several at once, each has its part; and when
//! there are as many pictures as threads, each is drawn on the thread that asked for it, without a
//! word between them. Parts are decided when a picture begins, so that a long one keeps what it
//! got, and the system shares out the rest.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Threads for drawing.
#[derive(Debug)]
pub struct DrawingThreads {
    /// None: there is one thread, which is the caller's.
    pool: Option<ThreadPool>,
    /// Pictures that are being drawn.
    drawing: AtomicUsize,
}

/// The part of the threads that one picture has. It ends when this is dropped.
pub struct Share<'a> {
    threads: &'a DrawingThreads,
    /// Their number, at least 1.
    pub count: usize,
}

impl DrawingThreads {
    /// A pool of `count` threads, or of one if the system gives no more.
    pub fn new(count: usize) -> Self {
        let build = || ThreadPoolBuilder::new().num_threads(count).thread_name(|i| format!("raster-{i}"));
        // One thread needs no pool.
        let pool = if count > 1 { build().build().ok() } else { None };
        Self { pool, drawing: AtomicUsize::new(0) }
    }

    /// The number of threads.
    pub fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, ThreadPool::current_num_threads)
    }

    /// Begins a picture.
    pub fn share(&self) -> Share<'_> {
        let drawing = self.drawing.fetch_add(1, Ordering::Relaxed) + 1;
        Share { threads: self, count: (self.count() / drawing).max(1) }
    }
}

impl<'a> Share<'a> {
    /// The pool to draw on; None: the caller's thread alone.
    pub fn pool(&self) -> Option<&'a ThreadPool> {
        self.threads.pool.as_ref().filter(|_| self.count > 1)
    }
}

impl Drop for Share<'_> {
    fn drop(&mut self) {
        self.threads.drawing.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_at_once_divide_the_threads() {
        let threads = DrawingThreads::new(4);
        let alone = threads.share();
        assert_eq!((alone.count, alone.pool().is_some()), (4, true));
        let second = threads.share();
        assert_eq!((second.count, second.pool().is_some()), (2, true));
        let more = [threads.share(), threads.share(), threads.share()];
        assert_eq!(more.each_ref().map(|share| share.count), [1; 3]);
        assert!(more.iter().all(|share| share.pool().is_none()));
        drop((alone, second, more));
        assert_eq!(threads.share().count, 4, "what has ended counts no more");
        let one = DrawingThreads::new(1);
        assert_eq!((one.share().count, one.share().pool().is_some()), (1, false));
    }
}
