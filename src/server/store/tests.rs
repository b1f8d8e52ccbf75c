use super::*;

fn mesh(name: &str, bytes: usize) -> NewMesh {
    let digest = Digest::of(name.as_bytes());
    // The path is "mesh", 4 bytes.
    let bundle = Bundle::of_one(vec![b'v'; bytes - 4]);
    NewMesh { digest, bundle, reading: Reading::default(), report: Bytes::new(), owners: vec![Owner::default()] }
}

/// Where there are no keys, everybody sees everything.
fn all() -> Access {
    Access::open(Owner::default())
}

fn has(store: &Store, names: &[&str]) -> Vec<bool> {
    let inner = store.lock();
    names.iter().map(|name| inner.meshes.contains_key(&Digest::of(name.as_bytes()))).collect()
}

fn store(bytes: u64, count: usize) -> Store {
    Store::new(None, Memory::unlimited(&[(Account::Meshes, bytes)]), count)
}

#[test]
fn the_least_recently_used_goes_first() {
    let store = store(100, 10);
    for name in ["a", "b", "c"] {
        assert_eq!(store.insert(mesh(name, 30), [].into()), Ok(true));
    }
    assert_eq!(store.insert(mesh("a", 30), [].into()), Ok(false), "known, and so used");
    assert!(store.find(Digest::of(b"b"), &all()).is_some());
    assert_eq!(store.insert(mesh("d", 30), [].into()), Ok(true));
    assert_eq!(has(&store, &["a", "b", "c", "d"]), [true, true, false, true]);
    assert_eq!(store.insert(mesh("e", 70), [].into()), Ok(true));
    assert_eq!(has(&store, &["a", "b", "c", "d", "e"]), [false, false, false, true, true]);
    assert_eq!(store.load(), StoreLoad { count: 2, bytes: 100 });
    assert_eq!(store.insert(mesh("f", 101), [].into()), Err(StoreError::TooLarge { bytes: 101, limit: 100 }));
    assert_eq!(store.load().count, 2, "what cannot be stored costs nobody else");
}

#[test]
fn no_more_than_the_count_stay() {
    let store = store(1000, 2);
    for name in ["a", "b", "c"] {
        assert_eq!(store.insert(mesh(name, 5), [].into()), Ok(true));
    }
    assert_eq!(has(&store, &["a", "b", "c"]), [false, true, true]);
    assert!(
        store.remove(Digest::of(b"b"), &all()) == Removed::Gone
            && store.remove(Digest::of(b"b"), &all()) == Removed::Unknown
    );
    assert_eq!(store.load(), StoreLoad { count: 1, bytes: 5 });
    assert_eq!(store.lock().by_use.len(), 1);
    store.insert(mesh("d", 5), [].into()).unwrap();
    let held = ["c", "d"].map(|name| store.find(Digest::of(name.as_bytes()), &all()).unwrap());
    assert_eq!(store.insert(mesh("e", 5), [].into()), Err(StoreError::Busy { flag: "--mesh-count" }));
    drop(held);
    assert_eq!(store.insert(mesh("e", 5), [].into()), Ok(true));
}

#[test]
fn what_is_held_stays_and_counts_until_it_is_let_go() {
    let store = store(100, 10);
    for name in ["a", "b"] {
        store.insert(mesh(name, 40), [].into()).unwrap();
    }
    let held = store.find(Digest::of(b"a"), &all()).unwrap();
    let memory = held.memory.clone();
    drop(held);
    store.find(Digest::of(b"b"), &all()).unwrap();
    assert_eq!(store.insert(mesh("c", 40), [].into()), Ok(true));
    assert_eq!(has(&store, &["a", "b", "c"]), [true, false, true], "the oldest is held");
    assert_eq!(store.insert(mesh("d", 80), [].into()), Err(StoreError::Busy { flag: "--mesh-bytes" }));
    assert_eq!(store.remove(Digest::of(b"a"), &all()), Removed::Gone, "forgotten");
    assert_eq!(store.load().bytes, 40, "and still there");
    drop(memory);
    assert_eq!(store.load().bytes, 0);
    assert_eq!(store.insert(mesh("d", 80), [].into()), Ok(true));
}

#[test]
fn many_threads_never_exceed_the_memory() {
    let store = store(1000, 7);
    let stored = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let (store, stored) = (&store, &stored);
            scope.spawn(move || {
                for round in 0..300 {
                    let name = format!("{}", (thread * 31 + round * 7) % 40);
                    if store.insert(mesh(&name, 50 + round), [].into()).is_ok() {
                        stored.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    }
                    let load = store.load();
                    assert!(load.bytes <= 1000 && load.count <= 7, "{load:?}");
                    if round % 5 == 0 {
                        store.remove(Digest::of(name.as_bytes()), &all());
                    }
                }
            });
        }
    });
    assert!(stored.into_inner() > 1000);
    let inner = store.lock();
    assert_eq!(inner.meshes.len(), inner.by_use.len());
}

#[test]
fn a_mesh_is_its_owners_and_goes_with_the_last_of_them() {
    let store = store(100, 10);
    let of = |name: &str| NewMesh { owners: vec![Owner::new(name)], ..mesh("a", 30) };
    let access = |name: &str| {
        let mut access = Access::default();
        access.owner = Owner::new(name);
        access
    };
    let (a, [one, two, three]) = (Digest::of(b"a"), ["one", "two", "three"].map(access));
    assert_eq!(store.insert(of("one"), [].into()), Ok(true));
    assert!(store.find(a, &one).is_some() && store.find(a, &two).is_none() && store.find(a, &all()).is_some());
    assert_eq!(store.insert(of("two"), [].into()), Ok(true), "new for this one");
    assert_eq!(store.insert(of("two"), [].into()), Ok(false));
    assert_eq!(store.load(), StoreLoad { count: 1, bytes: 30 }, "stored once");
    assert_eq!(store.remove(a, &three), Removed::Unknown);
    assert_eq!(store.remove(a, &one), Removed::OfOthers);
    assert!(store.find(a, &one).is_none() && store.find(a, &two).is_some());
    assert_eq!(store.remove(a, &one), Removed::Unknown);
    assert_eq!(store.remove(a, &two), Removed::Gone);
    assert_eq!(store.load(), StoreLoad::default());
    store.insert(of("one"), [].into()).unwrap();
    store.insert(of("two"), [].into()).unwrap();
    assert_eq!(store.remove(a, &all()), Removed::Gone, "for all of them");
}
