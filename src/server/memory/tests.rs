use bytes::Bytes;

use super::*;
use meshsnap_render::limits::{Budget, Lend, Limits};

const UPLOADS: Account = Account::Uploads;

fn memory(all: u64, job: u64, accounts: &[(Account, u64)]) -> Arc<Memory> {
    Memory::new(&MemoryLimits { all, job, accounts: accounts.to_vec() })
}

#[test]
fn what_is_taken_comes_back() {
    let memory = memory(1000, 0, &[(UPLOADS, 100)]);
    let first = memory.share(UPLOADS);
    first.grow(60).unwrap();
    let second = memory.share(UPLOADS);
    let full = MemoryFull::Account { account: UPLOADS, limit: 100 };
    assert_eq!(second.grow(41), Err(full));
    second.grow(40).unwrap();
    assert_eq!(second.grow(u64::MAX), Err(full));
    assert_eq!((memory.used(UPLOADS), memory.refusals(UPLOADS)), (100, 2));
    drop(first);
    assert_eq!(memory.used(UPLOADS), 40);
    let (part, rest) = (second.split(30), second.split(u64::MAX));
    drop(second);
    assert_eq!((memory.used(UPLOADS), part.bytes(), rest.bytes()), (40, 30, 10));
    drop(part);
    rest.shrink_to(4);
    assert_eq!(memory.used(UPLOADS), 4);
    drop(rest);
    assert_eq!(memory.used_in_all(), 0);
}

#[test]
fn the_other_accounts_leave_jobs_their_part() {
    let memory = memory(1000, 400, &[]);
    let shares = [Account::Uploads, Account::Meshes, Account::Residents].map(|account| memory.share(account));
    shares.iter().for_each(|share| share.grow(200).unwrap());
    assert_eq!(memory.share(Account::Results).grow(1), Err(MemoryFull::Process { limit: 1000 }));
    let job = memory.share(Account::Jobs);
    job.grow(400).unwrap();
    assert_eq!(job.grow_now(1), Err(Some(1)));
    assert!(memory.could_run(600) && !memory.could_run(601), "a cache is no obstacle");
    // A job may have what the others leave.
    drop(shares);
    job.grow(600).unwrap();
    assert_eq!(memory.share(UPLOADS).grow_now(1), Err(Some(1)));
}

/// A cache of shares of 100 bytes.
fn cache(memory: &Arc<Memory>, account: Account, count: usize) -> Arc<Mutex<Vec<MemoryShare>>> {
    let shares: Vec<_> = (0..count).map(|_| memory.share(account)).collect();
    shares.iter().for_each(|share| share.grow(100).unwrap());
    let cache = Arc::new(Mutex::new(shares));
    let weak = Arc::downgrade(&cache);
    memory.shrinks(account, move |bytes| {
        let cache = weak.upgrade().unwrap();
        let mut shares = cache.lock().unwrap();
        let left = shares.len().saturating_sub(bytes.div_ceil(100) as usize);
        shares.truncate(left);
    });
    cache
}

#[test]
fn caches_shrink_before_anybody_is_refused() {
    let memory = memory(1000, 100, &[]);
    let (residents, pictures) = (cache(&memory, Account::Residents, 5), cache(&memory, Account::Pictures, 4));
    let upload = memory.share(UPLOADS);
    upload.grow(250).unwrap();
    assert_eq!((residents.lock().unwrap().len(), pictures.lock().unwrap().len()), (2, 4), "no more than needed");
    upload.grow(300).unwrap();
    assert_eq!((residents.lock().unwrap().len(), pictures.lock().unwrap().len()), (0, 3));
    // A cache makes room for itself alone.
    assert!(memory.share(Account::Residents).grow(100).is_err());
    assert_eq!(pictures.lock().unwrap().len(), 3);
    memory.share(Account::Pictures).grow(100).unwrap();
    upload.grow(350).unwrap();
    assert!(upload.grow(1).is_err());
    assert_eq!(memory.used_in_all(), 900);
}

#[test]
fn bytes_count_once_and_as_long_as_anything_holds_them() {
    let memory = memory(1000, 100, &[(Account::Results, 10)]);
    let (bytes, share) = counted(&memory, Bytes::from(vec![7; 300]));
    assert_eq!(memory.used(Account::Answers), 300);
    let keeping = Keeping::new(share, Account::Results);
    assert_eq!((memory.used(Account::Answers), memory.used(Account::Results)), (0, 300), "what exists is not refused");
    let answer = bytes.slice(100..);
    drop(bytes);
    drop(keeping);
    assert_eq!((memory.used(Account::Answers), memory.used(Account::Results)), (300, 0), "it is still being sent");
    assert_eq!(answer[..], [7; 200]);
    drop(answer);
    assert_eq!(memory.used_in_all(), 0);
}

#[test]
fn a_job_grows_and_gives_everything_back() {
    let memory = memory(1000, 500, &[]);
    let share = memory.share(Account::Jobs);
    share.grow(100).unwrap();
    let job = JobMemory::new(share, 500);
    let lender: Option<Arc<dyn Lend>> = Some(job.clone());
    let mut budget = Budget::lent(&Limits::default(), lender.clone());
    budget.spend("a list", 300, 1).unwrap();
    assert_eq!(memory.used(Account::Jobs), 300);
    // A copy spends what the first one has left, not more of the share.
    budget.clone().spend("a copy", 100, 1).unwrap();
    budget.clone().spend("a copy", 100, 1).unwrap();
    assert_eq!(memory.used(Account::Jobs), 400);
    let never = budget.spend("a large list", 300, 1).unwrap_err();
    assert_eq!((never.flag, never.limit, job.was_refused()), ("--memory-bytes", 500, false));
    let other = memory.share(Account::Jobs);
    other.grow(600).unwrap();
    assert!(budget.spend("a list", 150, 1).is_err() && job.was_refused());
    // What a cache counts from now on.
    job.restart();
    assert_eq!(memory.used(Account::Jobs), 600);
    let mut after = budget.lent_by(lender, budget.spent_bytes());
    after.spend("a list", 50, 1).unwrap();
    assert_eq!((memory.used(Account::Jobs), job.peak()), (650, 50));
    job.release();
    drop((job, after, budget, other));
    assert_eq!(memory.used_in_all(), 0);
}

#[test]
fn threads_that_take_and_give_never_exceed_the_budget_nor_wait_for_each_other() {
    const THREADS: u64 = 8;
    const ROUNDS: u64 = 3000;
    let memory = memory(10_000, 2000, &[(UPLOADS, 4000)]);
    let cached = cache(&memory, Account::Residents, 20);
    let counts: Vec<(u64, u64)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS)
            .map(|thread| {
                let (memory, cached) = (&memory, &cached);
                scope.spawn(move || {
                    let (mut had, mut refused, mut seed) = (0, 0, thread + 1);
                    let mut held = std::collections::VecDeque::new();
                    for _ in 0..ROUNDS {
                        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                        let account = Account::ALL[(seed >> 40) as usize % 6];
                        let share = memory.share(account);
                        if share.grow((seed >> 33) % 1500).is_err() {
                            refused += 1;
                            continue;
                        }
                        had += 1;
                        assert!(memory.used_in_all() <= 10_000);
                        match seed % 3 {
                            0 => share.move_to(account),
                            1 => drop(share.split(100)),
                            // Without a lock on the cache, as the rule says.
                            _ => cached.lock().unwrap().push(share.split(0)),
                        }
                        held.push_back(share);
                        if held.len() > 3 {
                            held.pop_front();
                        }
                    }
                    (had, refused)
                })
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let (had, refused) = counts.iter().fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
    println!("{had} had memory, {refused} were refused");
    assert_eq!(had + refused, THREADS * ROUNDS);
    assert!(had > 0 && refused > 0);
    drop(std::mem::take(&mut *cached.lock().unwrap()));
    assert_eq!(memory.used_in_all(), 0);
}
