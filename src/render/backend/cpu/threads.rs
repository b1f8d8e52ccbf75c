//! The threads that draw on the CPU, shared by all renderers that are given them.
//!
//! A picture that begins alone uses all of them. While `n` pictures are drawn, each draws its bands (ranges of rows)
//! on one n-th of the threads, but at least one; where that is less than 2 threads when a picture begins, it is
//! drawn on its caller's thread. So when another picture begins, a picture gives up threads as soon as they have
//! drawn their bands. A picture never has more threads than it began with.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Vertices, triangles or edges that a thread takes at a time, where a list is divided.
pub const CHUNK: usize = 8192;

/// Threads for drawing.
#[derive(Debug)]
pub struct DrawingThreads {
    /// None: there is one thread, which is the caller's.
    pool: Option<ThreadPool>,
    /// The pool's threads.
    handles: Vec<JoinHandle<()>>,
    /// Pictures that are being drawn.
    drawing: AtomicUsize,
}

/// The part of the threads that one picture has. It ends when this is dropped.
pub struct ThreadShare<'a> {
    threads: &'a DrawingThreads,
    /// Their number, at least 1.
    pub count: usize,
}

impl DrawingThreads {
    /// A pool of `count` threads, or of one if the system gives no more.
    pub fn new(count: usize) -> Self {
        let mut handles = Vec::new();
        let spawn = |thread: rayon::ThreadBuilder| {
            let named = thread::Builder::new().name(format!("raster-{}", thread.index()));
            handles.push(named.spawn(|| thread.run())?);
            Ok(())
        };
        // One thread needs no pool.
        let build = || ThreadPoolBuilder::new().num_threads(count).spawn_handler(spawn).build().ok();
        let pool = if count > 1 { build() } else { None };
        Self { pool, handles, drawing: AtomicUsize::new(0) }
    }

    /// The number of threads.
    pub fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, ThreadPool::current_num_threads)
    }

    /// Runs `work` on one of the threads, so that what it divides among threads is done by these; by
    /// the caller if there is one.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Begins a picture.
    pub fn share(&self) -> ThreadShare<'_> {
        self.drawing.fetch_add(1, Ordering::Relaxed);
        ThreadShare { threads: self, count: self.part() }
    }

    /// Threads for each of the pictures that are being drawn now.
    fn part(&self) -> usize {
        (self.count() / self.drawing.load(Ordering::Relaxed).max(1)).max(1)
    }
}

/// Waits for the threads' ends. The driver of a GPU is called once more when a thread that has used it ends. NVIDIA's driver
/// (580.159) waits for ever if the device is destroyed at that moment: one process in a hundred hung at its exit.
impl Drop for DrawingThreads {
    fn drop(&mut self) {
        // Rayon asks its threads to end, and does not wait.
        self.pool = None;
        let own = thread::current().id();
        if self.handles.iter().any(|handle| handle.thread().id() == own) {
            // They end when the work is done that drops them.
            return;
        }
        for handle in self.handles.drain(..) {
            // Rayon's threads do not panic: it hands on the panics of what they run.
            let _ = handle.join();
        }
    }
}

impl<'a> ThreadShare<'a> {
    /// The pool to draw on; None: the caller's thread alone.
    pub fn pool(&self) -> Option<&'a ThreadPool> {
        self.threads.pool.as_ref().filter(|_| self.count > 1)
    }

    /// Runs `each` over the items, for `at_once` of them at a time or fewer: where other pictures
    /// have begun, some threads are left to them after their item.
    pub fn run<T: Send>(&self, at_once: usize, items: impl Iterator<Item = T> + Send, each: impl Fn(T) + Sync + Send) {
        let Some(pool) = self.pool() else {
            items.for_each(each);
            return;
        };
        let items = Mutex::new(items);
        let next = || items.lock().unwrap_or_else(PoisonError::into_inner).next();
        pool.install(|| {
            (0..at_once).into_par_iter().with_max_len(1).for_each(|loop_index| {
                while (loop_index == 0 || loop_index < self.threads.part())
                    && let Some(item) = next()
                {
                    each(item);
                }
            });
        });
    }
}

impl Drop for ThreadShare<'_> {
    fn drop(&mut self) {
        self.threads.drawing.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Results of `each` for the items, in their order. They are found on the pool if there is one.
pub fn map<T: Send, U: Send>(pool: Option<&ThreadPool>, items: Vec<T>, each: impl Fn(T) -> U + Sync + Send) -> Vec<U> {
    match pool {
        Some(pool) => pool.install(|| items.into_par_iter().map(each).collect()),
        None => items.into_iter().map(each).collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::{Arc, mpsc};
    use std::time::Duration;

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

    /// Counts the very end of a thread, when its thread-local values are dropped.
    struct AtTheEnd(Arc<AtomicUsize>);

    impl Drop for AtTheEnd {
        fn drop(&mut self) {
            thread::sleep(Duration::from_millis(20));
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn threads_have_ended_when_their_pool_is_gone() {
        thread_local!(static LEFT: Cell<Option<AtTheEnd>> = const { Cell::new(None) });
        let ended = Arc::new(AtomicUsize::new(0));
        let threads = DrawingThreads::new(3);
        threads.pool.as_ref().unwrap().broadcast(|_| LEFT.set(Some(AtTheEnd(ended.clone()))));
        drop(threads);
        assert_eq!(ended.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn one_of_the_threads_may_be_the_last_that_has_them() {
        let (ended, end) = mpsc::channel();
        let threads = Arc::new(DrawingThreads::new(2));
        let own = threads.clone();
        let (gone, is_gone) = mpsc::channel::<()>();
        threads.pool.as_ref().unwrap().spawn(move || {
            let _ = is_gone.recv();
            drop(own);
            ended.send(()).unwrap();
        });
        drop((threads, gone));
        end.recv().unwrap();
    }

    /// Picture 1 has four threads and a thousand bands. The first four are let go when picture 2 has
    /// begun, and the others when it is drawn. So two threads of picture 1 are left to picture 2.
    #[test]
    fn a_picture_gives_up_threads_between_two_bands() {
        let threads = DrawingThreads::new(4);
        let (begun, begins) = mpsc::channel();
        let (first, first_gates): (Vec<_>, Vec<_>) = (0..4).map(|_| mpsc::channel::<()>()).unzip();
        let first_gates: Vec<_> = first_gates.into_iter().map(Mutex::new).collect();
        let (others, others_gate) = mpsc::channel::<()>();
        let others_gate = Mutex::new(others_gate);
        let (drawn, second_drawn) = mpsc::channel();
        let finished = AtomicUsize::new(0);
        thread::scope(|scope| {
            let (threads, finished) = (&threads, &finished);
            scope.spawn(move || {
                threads.share().run(4, 0..1000, |band| {
                    let _ = begun.send(());
                    let _ = first_gates.get(band).unwrap_or(&others_gate).lock().unwrap().recv();
                    finished.fetch_add(1, Ordering::Relaxed);
                });
            });
            (0..4).for_each(|_| begins.recv().unwrap());
            scope.spawn(move || {
                let share = threads.share();
                assert_eq!(share.count, 2);
                drop(first);
                share.run(2, 0..10, |_| drawn.send(finished.load(Ordering::Relaxed)).unwrap());
                drop(others);
            });
        });
        let at_bands: Vec<usize> = second_drawn.iter().collect();
        assert_eq!(at_bands.len(), 10);
        assert!(at_bands.iter().all(|&finished| finished <= 4), "{at_bands:?}");
        assert_eq!(finished.into_inner(), 1000);
    }
}
