//! Rate limits of each client (an API key, or an address where there are no keys): how many requests per second, how
//! many in a burst, and how many uploads and jobs (POST and PUT) per day. What is used comes back steadily, not at
//! once at the end of a second or a day (a token bucket).
//!
//! Each server of a service of several counts what clients have asked of all: it tells the others what it has
//! admitted ([`Rates::take_spent`]), and counts what they have ([`Rates::add`]). So a client may get ahead of a limit by
//! what all servers admit until they have heard of each other, and then waits until that has come back.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::jobs::Owner;

const DAY_S: f64 = 24.0 * 3600.0;

/// Requests after which parties are forgotten that have asked for little: their memory is all that they cost.
const FORGET_EVERY: u64 = 4096;

/// Parties of which the other servers are told at a time, at most.
const UNTOLD_MAX: usize = 100_000;

/// The error of a party that asks for too much.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TooMuch {
    /// It sends requests too fast.
    #[error("more than {per_s} requests a second come from this client; try again in {} s", .wait.as_secs_f64().ceil())]
    Rate {
        /// Requests that it may send in a second.
        per_s: u32,
        /// Time until the next one is accepted.
        wait: Duration,
    },
    /// It has sent its share of the day.
    #[error("this client has sent {per_day} meshes or jobs, its share of a day; try again in {} s", .wait.as_secs_f64().ceil())]
    Day {
        /// Pieces of work that it may send in a day.
        per_day: u32,
        /// Time until the next one is accepted.
        wait: Duration,
    },
}

impl TooMuch {
    /// Seconds until the next request is accepted, if no other comes before.
    pub fn retry_after_s(&self) -> u64 {
        let (Self::Rate { wait, .. } | Self::Day { wait, .. }) = self;
        (wait.as_secs_f64().ceil() as u64).max(1)
    }
}

/// The requests of each party.
pub struct Rates {
    rate: Option<Limit>,
    day: Option<Limit>,
    used: Mutex<HashMap<Owner, Used>>,
    checks: AtomicU64,
    /// The requests that were admitted since the other servers were told. None: there are no others.
    untold: Option<Mutex<HashMap<Owner, Spent>>>,
}

/// The number of requests that were admitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spent {
    /// All of them.
    pub requests: u32,
    /// Those that count for the day.
    pub works: u32,
}

/// A limit: `number` in a second or a day, and up to `burst` at once.
#[derive(Clone, Copy)]
struct Limit {
    number: u32,
    burst: f64,
    per_s: f64,
}

/// The part of each limit that a party has used and that has not come back, at a moment.
#[derive(Clone, Copy)]
struct Used {
    at: Instant,
    rate: f64,
    day: f64,
}

impl Rates {
    /// Nobody has asked for anything. 0 of anything is no limit; a burst of 0 is that of a second. `is_shared`: other
    /// servers are to be told of what is admitted.
    pub fn new(per_s: u32, burst: u32, per_day: u32, is_shared: bool) -> Self {
        let limit = |number: u32, burst: u32, per_s: f64| {
            (number > 0).then(|| Limit { number, burst: f64::from(if burst == 0 { number } else { burst }), per_s })
        };
        let rate = limit(per_s, burst, f64::from(per_s));
        let day = limit(per_day, 0, f64::from(per_day) / DAY_S);
        let untold = (is_shared && (rate.is_some() || day.is_some())).then(Mutex::default);
        Self { rate, day, used: Mutex::default(), checks: AtomicU64::new(0), untold }
    }

    /// Counts a request, and refuses it if it is too much. `is_work`: it counts for the day.
    pub fn check(&self, party: &Owner, is_work: bool) -> Result<(), TooMuch> {
        if self.rate.is_none() && self.day.is_none() {
            return Ok(());
        }
        self.forget_now_and_then();
        let mut all = lock(&self.used);
        let used = self.used_now(&mut all, party);
        let wait = |limit: &Limit, used: f64| {
            let too_much = used + 1.0 - limit.burst;
            (too_much > 0.0).then(|| Duration::from_secs_f64((too_much / limit.per_s).min(1e9)))
        };
        if let Some(limit) = &self.rate
            && let Some(wait) = wait(limit, used.rate)
        {
            return Err(TooMuch::Rate { per_s: limit.number, wait });
        }
        if let Some(limit) = self.day.as_ref().filter(|_| is_work)
            && let Some(wait) = wait(limit, used.day)
        {
            return Err(TooMuch::Day { per_day: limit.number, wait });
        }
        used.rate += 1.0;
        used.day += f64::from(u8::from(is_work));
        drop(all);
        if let Some(untold) = &self.untold {
            let mut untold = lock(untold);
            // While the others cannot be told, as many clients are enough.
            if untold.len() < UNTOLD_MAX || untold.contains_key(party) {
                let spent = untold.entry(party.clone()).or_default();
                spent.requests = spent.requests.saturating_add(1);
                spent.works = spent.works.saturating_add(u32::from(is_work));
            }
        }
        Ok(())
    }

    /// The requests that were admitted since the last call.
    pub fn take_spent(&self) -> Vec<(Owner, Spent)> {
        self.untold.as_ref().map_or_else(Vec::new, |untold| std::mem::take(&mut *lock(untold)).into_iter().collect())
    }

    /// The others cannot be told at this moment. What counts for a second is over when they can be.
    pub fn hold_spent(&self) {
        if let Some(untold) = &self.untold {
            lock(untold).retain(|_, spent| {
                spent.requests = 0;
                spent.works > 0
            });
        }
    }

    /// Counts what another server has admitted.
    pub fn add(&self, party: &Owner, spent: Spent) {
        self.forget_now_and_then();
        let mut all = lock(&self.used);
        let used = self.used_now(&mut all, party);
        used.rate += f64::from(spent.requests);
        used.day += f64::from(spent.works);
    }

    /// The part of its share of the day that each party has used, but for what the others will be told of; at most `most` parties,
    /// those that have used the most.
    pub fn of_day(&self, most: usize) -> Vec<(Owner, f64)> {
        let Some(limit) = &self.day else { return Vec::new() };
        let now = Instant::now();
        let untold: HashMap<Owner, u32> = match &self.untold {
            Some(untold) => lock(untold).iter().map(|(party, spent)| (party.clone(), spent.works)).collect(),
            None => HashMap::new(),
        };
        let all = lock(&self.used).iter().map(|(party, used)| (party.clone(), *used)).collect::<Vec<_>>();
        let told = |(party, used): (Owner, Used)| {
            let untold = untold.get(&party).map_or(0.0, |works| f64::from(*works));
            (party, limit.left(used.day, now, used.at) - untold)
        };
        let mut used: Vec<_> = all.into_iter().map(told).filter(|(_, used)| *used > 0.0).collect();
        if used.len() > most {
            used.select_nth_unstable_by(most, |(_, a), (_, b)| b.total_cmp(a));
            used.truncate(most);
        }
        used
    }

    /// Parties have used at least this of their share of the day.
    pub fn learn_of_day(&self, parties: impl Iterator<Item = (Owner, f64)>) {
        if self.day.is_none() {
            return;
        }
        let mut all = lock(&self.used);
        for (party, known) in parties {
            let used = self.used_now(&mut all, &party);
            used.day = used.day.max(known.min(f64::from(u32::MAX)));
        }
    }

    /// The use of a party, less what has come back.
    fn used_now<'a>(&self, all: &'a mut HashMap<Owner, Used>, party: &Owner) -> &'a mut Used {
        let now = Instant::now();
        let used = all.entry(party.clone()).or_insert(Used { at: now, rate: 0.0, day: 0.0 });
        let left = |limit: &Option<Limit>, amount: f64| limit.map_or(0.0, |limit| limit.left(amount, now, used.at));
        *used = Used { at: now, rate: left(&self.rate, used.rate), day: left(&self.day, used.day) };
        used
    }

    fn forget_now_and_then(&self) {
        if self.checks.fetch_add(1, Ordering::Relaxed) % FORGET_EVERY != FORGET_EVERY - 1 {
            return;
        }
        let now = Instant::now();
        let is_used =
            |limit: &Option<Limit>, amount: f64, at| limit.is_some_and(|limit| limit.left(amount, now, at) > 0.0);
        lock(&self.used)
            .retain(|_, used| is_used(&self.rate, used.rate, used.at) || is_used(&self.day, used.day, used.at));
    }
}

impl Limit {
    /// The rest of what was used at a moment: the other part has come back since.
    fn left(&self, amount: f64, now: Instant, then: Instant) -> f64 {
        (amount - self.per_s * now.saturating_duration_since(then).as_secs_f64()).max(0.0)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use crate::rates::*;

    #[test]
    fn each_party_has_its_own_share() {
        let rates = Rates::new(1, 3, 0, false);
        let [one, two] = ["one", "two"].map(Owner::new);
        let began = Instant::now();
        let refused = (0..20).filter(|_| rates.check(&one, true).is_err()).count();
        assert!(refused + 3 + began.elapsed().as_secs() as usize >= 19, "{refused}");
        let error = rates.check(&one, false).unwrap_err();
        assert!(matches!(error, TooMuch::Rate { per_s: 1, .. }) && error.retry_after_s() == 1, "{error}");
        rates.check(&two, true).unwrap();

        let days = Rates::new(0, 0, 2, false);
        days.check(&one, true).unwrap();
        days.check(&one, true).unwrap();
        let error = days.check(&one, true).unwrap_err();
        assert!((43_000..=43_200).contains(&error.retry_after_s()), "the next one comes in half a day: {error}");
        days.check(&one, false).unwrap();
        days.check(&two, true).unwrap();
        let none = Rates::new(0, 5, 0, true);
        assert!((0..1000).all(|_| none.check(&one, true).is_ok()));
        assert!(none.take_spent().is_empty());
    }

    #[test]
    fn parties_that_are_gone_take_no_memory() {
        let rates = Rates::new(1000, 1, 0, false);
        for number in 0..5 * FORGET_EVERY {
            rates.check(&Owner::new(&number.to_string()), true).unwrap();
        }
        std::thread::sleep(Duration::from_millis(20));
        // Those that other servers tell of are forgotten, too.
        for _ in 0..FORGET_EVERY {
            rates.add(&Owner::new("last"), Spent { requests: 1, works: 1 });
        }
        let count = lock(&rates.used).len();
        assert!(count <= 1, "{count}");
    }

    /// Several servers tell each other what they admit, after each round.
    #[test]
    fn servers_that_tell_each_other_admit_one_share() {
        let servers = [(); 4].map(|()| Rates::new(0, 0, 100, true));
        let party = Owner::new("one");
        let mut admitted = 0;
        for _ in 0..30 {
            admitted +=
                servers.iter().map(|rates| (0..3).filter(|_| rates.check(&party, true).is_ok()).count()).sum::<usize>();
            for i in 0..servers.len() {
                for (party, spent) in servers[i].take_spent() {
                    servers.iter().enumerate().filter(|(j, _)| *j != i).for_each(|(_, other)| other.add(&party, spent));
                }
            }
        }
        // A round has 12 requests, and the last one that is admitted may be whole.
        assert!((100..112).contains(&admitted), "{admitted}");
        // What is too much is waited for: a debt is not forgotten.
        let refused = servers[0].check(&party, true).unwrap_err();
        let waits_s = 864.0 * (admitted as f64 - 99.0);
        assert!((refused.retry_after_s() as f64 - waits_s).abs() < 10.0, "{refused} and not {waits_s}");

        // A server that starts later learns of it.
        let late = Rates::new(0, 0, 100, true);
        late.learn_of_day(servers[1].of_day(10).into_iter());
        let error = late.check(&party, true).unwrap_err();
        assert!((error.retry_after_s() as f64 - waits_s).abs() < 10.0, "{error}");
        late.learn_of_day([(party.clone(), 1.0)].into_iter());
        assert!(late.check(&party, true).is_err(), "less is no news");
        late.check(&Owner::new("two"), true).unwrap();
        // It will tell of this one, and so does not answer with it.
        let used = late.of_day(10);
        assert_eq!(used.iter().map(|(party, _)| party.to_string()).collect::<Vec<_>>(), ["one"]);
        assert_eq!((late.of_day(0).len(), servers[0].of_day(10).len()), (0, 1));
    }

    /// Requests of an outage are no debt of the seconds after it.
    #[test]
    fn what_could_not_be_told_in_its_second_is_not_told() {
        let [a, b] = [(); 2].map(|()| Rates::new(1000, 1000, 1000, true));
        let party = Owner::new("one");
        (0..10).for_each(|i| a.check(&party, i < 3).unwrap());
        a.check(&Owner::new("two"), false).unwrap();
        a.hold_spent();
        a.check(&party, true).unwrap();
        let told = a.take_spent();
        assert_eq!(told, [(party.clone(), Spent { requests: 1, works: 4 })]);
        b.add(&party, told[0].1);
        assert_eq!(b.of_day(10).len(), 1);
    }
}
