//! Rate limits of each client (an API key, or an address where there are no keys): how many requests per second, how
//! many in a burst, and how many uploads and jobs (POST and PUT) per day. What is used comes back steadily, not at
//! once at the end of a second or a day.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use governor::clock::{Clock as _, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};

use super::jobs::Owner;

const DAY: Duration = Duration::from_secs(24 * 3600);

/// Requests after which parties are forgotten that have asked for little: their memory is all that they cost.
const FORGET_EVERY: u64 = 4096;

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

/// What each party has asked for.
pub struct Rates {
    clock: DefaultClock,
    rate: Option<(u32, DefaultKeyedRateLimiter<Owner>)>,
    day: Option<(u32, DefaultKeyedRateLimiter<Owner>)>,
    checks: AtomicU64,
}

impl Rates {
    /// Nobody has asked for anything. 0 of anything is no limit; a burst of 0 is that of a second.
    pub fn new(per_s: u32, burst: u32, per_day: u32) -> Self {
        let limiter = |number: NonZeroU32, quota: Quota| (number.get(), RateLimiter::keyed(quota));
        let rate = NonZeroU32::new(per_s).map(|per_s| {
            let burst = NonZeroU32::new(burst).unwrap_or(per_s);
            limiter(per_s, Quota::per_second(per_s).allow_burst(burst))
        });
        let day = NonZeroU32::new(per_day)
            .and_then(|number| Some(limiter(number, Quota::with_period(DAY / number.get())?.allow_burst(number))));
        Self { clock: DefaultClock::default(), rate, day, checks: AtomicU64::new(0) }
    }

    /// Counts a request, and refuses it if it is too much. `is_work`: it counts for the day.
    pub fn check(&self, party: &Owner, is_work: bool) -> Result<(), TooMuch> {
        if self.checks.fetch_add(1, Ordering::Relaxed) % FORGET_EVERY == FORGET_EVERY - 1 {
            [&self.rate, &self.day].into_iter().flatten().for_each(|(_, limiter)| limiter.retain_recent());
        }
        let wait = |limiter: &DefaultKeyedRateLimiter<Owner>| {
            limiter.check_key(party).err().map(|refused| refused.wait_time_from(self.clock.now()))
        };
        if let Some((per_s, limiter)) = &self.rate
            && let Some(wait) = wait(limiter)
        {
            return Err(TooMuch::Rate { per_s: *per_s, wait });
        }
        if let Some((per_day, limiter)) = self.day.as_ref().filter(|_| is_work)
            && let Some(wait) = wait(limiter)
        {
            return Err(TooMuch::Day { per_day: *per_day, wait });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::rates::*;

    #[test]
    fn each_party_has_its_own_share() {
        let rates = Rates::new(1, 3, 0);
        let [one, two] = ["one", "two"].map(Owner::new);
        let began = std::time::Instant::now();
        let refused = (0..20).filter(|_| rates.check(&one, true).is_err()).count();
        assert!(refused + 3 + began.elapsed().as_secs() as usize >= 19, "{refused}");
        let error = rates.check(&one, false).unwrap_err();
        assert!(matches!(error, TooMuch::Rate { per_s: 1, .. }) && error.retry_after_s() == 1, "{error}");
        rates.check(&two, true).unwrap();

        let days = Rates::new(0, 0, 2);
        days.check(&one, true).unwrap();
        days.check(&one, true).unwrap();
        let error = days.check(&one, true).unwrap_err();
        assert!((43_000..=43_200).contains(&error.retry_after_s()), "the next one comes in half a day: {error}");
        days.check(&one, false).unwrap();
        days.check(&two, true).unwrap();
        let none = Rates::new(0, 5, 0);
        assert!((0..1000).all(|_| none.check(&one, true).is_ok()));
    }

    #[test]
    fn parties_that_are_gone_take_no_memory() {
        let rates = Rates::new(1000, 1, 0);
        for number in 0..5 * FORGET_EVERY {
            rates.check(&Owner::new(&number.to_string()), true).unwrap();
        }
        std::thread::sleep(Duration::from_millis(20));
        for _ in 0..FORGET_EVERY {
            let _ = rates.check(&Owner::new("last"), true);
        }
        let (_, limiter) = rates.rate.as_ref().unwrap();
        assert!(limiter.len() <= 1, "{}", limiter.len());
    }
}
