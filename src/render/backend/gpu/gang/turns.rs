//! The order in which jobs that could be drawn together get their turns: each is drawn alone at once, or waits and is
//! then drawn in a gang (jobs that share dispatches).
//!
//! Of jobs that are alike, the first are drawn at once, each alone. Later ones wait while [`LEADERS`] jobs or gangs
//! of their kind are being drawn. When one of those is finished, the job that has waited longest becomes the leader
//! of the next gang: it draws for all of its kind that wait, as many as fit into a gang. So a job never waits only
//! for others to come, and the more jobs there are, the larger the gangs.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

use crate::limits::{Deadline, Stopped};

/// Jobs and gangs of a kind that are drawn at a time: the commands of some are recorded while the device draws others.
/// With 2, a device without much to do draws fewer pictures than if all jobs were drawn alone; with 8, a busy one draws
/// fewer (docs/gpu-notes.md).
const LEADERS: usize = 4;

/// Time between two looks of a waiting job at its deadline.
const LOOK: Duration = Duration::from_millis(2);

/// A job's share in a gang.
pub trait Seat {
    /// True if a gang can hold both.
    fn is_alike(&self, other: &Self) -> bool;

    /// Jobs in a gang of its kind, at most.
    fn gang_max(&self) -> usize;
}

/// The jobs of a device that wait for each other. `S` is a job's seat, `R` what a leader has drawn for all.
pub struct Turns<S, R>(Mutex<State<S, R>>);

struct State<S, R> {
    /// The oldest first.
    waiting: VecDeque<Waiting<S, R>>,
    /// The kind of each gang that is being drawn: the seat of one of its jobs.
    drawn: Vec<S>,
    number: u64,
}

struct Waiting<S, R> {
    number: u64,
    seat: S,
    news: mpsc::Sender<News<S, R>>,
}

/// News for a waiting job.
enum News<S, R> {
    /// It leads.
    Lead(Gang<S, R>),
    /// Its leader has drawn, and the job is the one of this number; or has failed.
    Drawn(Option<(R, usize)>),
}

/// A waiting job's end of the channel of its news.
type Hears<S, R> = mpsc::Receiver<News<S, R>>;

/// Jobs that are drawn together, the leader first.
struct Gang<S, R> {
    seats: Vec<S>,
    /// Of the others.
    news: Vec<mpsc::Sender<News<S, R>>>,
}

/// A job's turn.
pub enum Turn<'a, S: Seat + Clone, R: Clone> {
    /// It draws, for itself and maybe for others.
    Lead(Leading<'a, S, R>),
    /// Its leader has drawn, and the job is the one of this number; or has failed.
    Drawn(Option<(R, usize)>),
}

/// The lead of a gang. The next gang has its turn when this is dropped.
pub struct Leading<'a, S: Seat + Clone, R: Clone> {
    gang: Gang<S, R>,
    next: Next<'a, S, R>,
}

impl<S: Seat + Clone, R: Clone> Leading<'_, S, R> {
    /// The jobs to draw, the leader's own first.
    pub fn seats(&self) -> &[S] {
        &self.gang.seats
    }

    /// Ends the lead, and gives the others what was drawn; none if that has failed.
    pub fn give(self, drawn: Option<&R>) {
        let Self { gang, next } = self;
        drop(next);
        for (number, news) in (1..).zip(&gang.news) {
            // A job that has given up has dropped its end.
            let _ = news.send(News::Drawn(drawn.map(|drawn| (drawn.clone(), number))));
        }
    }
}

impl<S, R> Default for Turns<S, R> {
    fn default() -> Self {
        Self(Mutex::new(State { waiting: VecDeque::new(), drawn: Vec::new(), number: 0 }))
    }
}

impl<S: Seat + Clone, R: Clone> Turns<S, R> {
    /// Waits for the job's turn.
    pub fn turn(&self, seat: S, deadline: &Deadline) -> Result<Turn<'_, S, R>, Stopped> {
        let gang = match self.enter(seat) {
            Ok(gang) => gang,
            Err((number, news)) => match self.wait(number, &news, deadline)? {
                News::Lead(gang) => gang,
                News::Drawn(drawn) => return Ok(Turn::Drawn(drawn)),
            },
        };
        let next = Next { turns: self, kind: gang.seats[0].clone() };
        Ok(Turn::Lead(Leading { gang, next }))
    }

    /// A gang of one, if the job leads at once; or its number and where it hears of its turn.
    fn enter(&self, seat: S) -> Result<Gang<S, R>, (u64, Hears<S, R>)> {
        let mut state = self.lock();
        if state.drawn.iter().filter(|kind| kind.is_alike(&seat)).count() < LEADERS {
            state.drawn.push(seat.clone());
            return Ok(Gang { seats: vec![seat], news: Vec::new() });
        }
        let (news, hears) = mpsc::channel();
        state.number += 1;
        let number = state.number;
        state.waiting.push_back(Waiting { number, seat, news });
        Err((number, hears))
    }

    fn wait(&self, number: u64, news: &mpsc::Receiver<News<S, R>>, deadline: &Deadline) -> Result<News<S, R>, Stopped> {
        loop {
            match news.recv_timeout(LOOK) {
                Ok(news) => return Ok(news),
                // Its leader has panicked.
                Err(mpsc::RecvTimeoutError::Disconnected) => return Ok(News::Drawn(None)),
                Err(mpsc::RecvTimeoutError::Timeout) => {}
            }
            if let Err(stopped) = deadline.check() {
                self.lock().waiting.retain(|waiting| waiting.number != number);
                return match news.try_recv() {
                    // It was told to lead just now, and others wait for that.
                    Ok(lead @ News::Lead(_)) => Ok(lead),
                    _ => Err(stopped),
                };
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State<S, R>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Gives the turn to the next gang of the kind, when dropped.
struct Next<'a, S: Seat + Clone, R: Clone> {
    turns: &'a Turns<S, R>,
    kind: S,
}

impl<S: Seat + Clone, R: Clone> Drop for Next<'_, S, R> {
    fn drop(&mut self) {
        let mut state = self.turns.lock();
        let (mut seats, mut senders) = (Vec::new(), Vec::new());
        let mut left = VecDeque::with_capacity(state.waiting.len());
        for waiting in std::mem::take(&mut state.waiting) {
            if seats.len() < self.kind.gang_max().max(1) && waiting.seat.is_alike(&self.kind) {
                seats.push(waiting.seat);
                senders.push(waiting.news);
            } else {
                left.push_back(waiting);
            }
        }
        state.waiting = left;
        if senders.is_empty() {
            if let Some(at) = state.drawn.iter().position(|kind| kind.is_alike(&self.kind)) {
                state.drawn.swap_remove(at);
            }
            return;
        }
        let leader = senders.remove(0);
        // It listens: it leaves those that wait under this lock, before it stops listening.
        let _ = leader.send(News::Lead(Gang { seats, news: senders }));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::thread;

    use super::*;

    /// A job of a kind, with its number.
    #[derive(Clone)]
    struct Job(u32, u32);

    impl Seat for Job {
        fn is_alike(&self, other: &Self) -> bool {
            self.0 == other.0
        }

        fn gang_max(&self) -> usize {
            4
        }
    }

    type Drawn = Arc<Vec<u32>>;

    fn draw(
        turns: &Turns<Job, Drawn>,
        job: Job,
        deadline: &Deadline,
        lead: impl FnOnce(&[Job]) -> Option<Drawn>,
    ) -> Result<Option<(Drawn, usize)>, Stopped> {
        match turns.turn(job, deadline)? {
            Turn::Drawn(drawn) => Ok(drawn),
            Turn::Lead(leading) => {
                let drawn = lead(leading.seats());
                leading.give(drawn.as_ref());
                Ok(drawn.map(|drawn| (drawn, 0)))
            }
        }
    }

    #[test]
    fn each_job_gets_its_own_and_gangs_form_while_others_are_drawn() {
        let turns = Turns::<Job, Drawn>::default();
        let (gangs, together, largest) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
        let drawn = thread::scope(|scope| {
            let job = |number: u32| {
                let lead = |seats: &[Job]| {
                    assert!(seats.iter().all(|seat| seat.0 == seats[0].0) && seats.len() <= 4);
                    gangs.fetch_add(1, Ordering::Relaxed);
                    largest.fetch_max(seats.len(), Ordering::Relaxed);
                    together.fetch_add(seats.len(), Ordering::Relaxed);
                    thread::sleep(Duration::from_millis(1));
                    Some(Arc::new(seats.iter().map(|seat| seat.1).collect::<Vec<_>>()))
                };
                let (drawn, at) = draw(&turns, Job(number % 3, number), &Deadline::default(), lead).unwrap().unwrap();
                assert_eq!(drawn[at], number);
            };
            let threads: Vec<_> =
                (0..30).map(|thread| scope.spawn(move || (0..20).map(|n| job(thread + 30 * n)).count())).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).sum::<usize>()
        });
        assert_eq!((drawn, together.into_inner()), (600, 600));
        assert_eq!(largest.into_inner(), 4);
        assert!(gangs.into_inner() < 500);
        let state = turns.lock();
        assert!(state.waiting.is_empty() && state.drawn.is_empty());
    }

    #[test]
    fn jobs_that_stop_or_fail_hold_nobody_up() {
        let turns = Turns::<Job, Drawn>::default();
        let (stopped, failed, drawn) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
        thread::scope(|scope| {
            for number in 0..24 {
                let (turns, stopped, failed, drawn) = (&turns, &stopped, &failed, &drawn);
                scope.spawn(move || {
                    for n in 0..20 {
                        let deadline = if n % 3 == 0 { Deadline::after_polls(1) } else { Deadline::default() };
                        let lead = |seats: &[Job]| {
                            thread::sleep(Duration::from_millis(5));
                            assert!((number + n) % 7 != 0, "a leader that panics");
                            (n % 5 != 0).then(|| Arc::new(seats.iter().map(|seat| seat.1).collect()))
                        };
                        let draw = || draw(turns, Job(0, number), &deadline, lead);
                        match std::panic::catch_unwind(std::panic::AssertUnwindSafe(draw)) {
                            Ok(Ok(Some((all, at)))) => {
                                assert_eq!(all[at], number);
                                drawn.fetch_add(1, Ordering::Relaxed);
                            }
                            Ok(Ok(None)) | Err(_) => _ = failed.fetch_add(1, Ordering::Relaxed),
                            Ok(Err(Stopped)) => _ = stopped.fetch_add(1, Ordering::Relaxed),
                        }
                    }
                });
            }
        });
        let counts = [stopped, failed, drawn].map(AtomicUsize::into_inner);
        assert_eq!(counts.iter().sum::<usize>(), 480);
        assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
        let state = turns.lock();
        assert!(state.waiting.is_empty() && state.drawn.is_empty());
    }
}
