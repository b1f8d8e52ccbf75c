use super::*;

fn mesh(name: &str, bytes: usize) -> NewMesh {
    let digest = Digest::of(name.as_bytes());
    // The path is "mesh", 4 bytes.
    let bundle = Bundle::of_one(vec![b'v'; bytes - 4]);
    NewMesh { digest, bundle, reading: Reading::default(), report: Bytes::new(), owner: Owner::default() }
}

fn has(store: &Store, names: &[&str]) -> Vec<bool> {
    let inner = store.lock();
    names.iter().map(|name| inner.meshes.contains_key(&Digest::of(name.as_bytes()))).collect()
}

#[test]
fn the_least_recently_used_goes_first() {
    let store = Store::new(100, 10);
    for name in ["a", "b", "c"] {
        assert_eq!(store.insert(mesh(name, 30), [].into()), Ok(true));
    }
    assert_eq!(store.insert(mesh("a", 30), [].into()), Ok(false), "known, and so used");
    assert!(store.find(Digest::of(b"b")).is_some());
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
    let store = Store::new(1000, 2);
    for name in ["a", "b", "c"] {
        assert_eq!(store.insert(mesh(name, 5), [].into()), Ok(true));
    }
    assert_eq!(has(&store, &["a", "b", "c"]), [false, true, true]);
    assert!(store.remove(Digest::of(b"b")) && !store.remove(Digest::of(b"b")));
    assert_eq!(store.load(), StoreLoad { count: 1, bytes: 5 });
    assert_eq!(store.lock().by_use.len(), 1);
    store.insert(mesh("d", 5), [].into()).unwrap();
    let held = ["c", "d"].map(|name| store.find(Digest::of(name.as_bytes())).unwrap());
    assert_eq!(store.insert(mesh("e", 5), [].into()), Err(StoreError::Busy { flag: "--mesh-count" }));
    drop(held);
    assert_eq!(store.insert(mesh("e", 5), [].into()), Ok(true));
}

#[test]
fn what_is_held_stays_and_counts_until_it_is_let_go() {
    let store = Store::new(100, 10);
    for name in ["a", "b"] {
        store.insert(mesh(name, 40), [].into()).unwrap();
    }
    let held = store.find(Digest::of(b"a")).unwrap();
    let memory = held.memory.clone();
    drop(held);
    store.find(Digest::of(b"b")).unwrap();
    assert_eq!(store.insert(mesh("c", 40), [].into()), Ok(true));
    assert_eq!(has(&store, &["a", "b", "c"]), [true, false, true], "the oldest is held");
    assert_eq!(store.insert(mesh("d", 80), [].into()), Err(StoreError::Busy { flag: "--mesh-bytes" }));
    assert!(store.remove(Digest::of(b"a")), "forgotten");
    assert_eq!(store.load().bytes, 40, "and still there");
    drop(memory);
    assert_eq!(store.load().bytes, 0);
    assert_eq!(store.insert(mesh("d", 80), [].into()), Ok(true));
}

#[test]
fn many_threads_never_exceed_the_memory() {
    let store = Store::new(1000, 7);
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
                        store.remove(Digest::of(name.as_bytes()));
                    }
                }
            });
        }
    });
    assert!(stored.into_inner() > 1000);
    let inner = store.lock();
    assert_eq!(inner.meshes.len(), inner.by_use.len());
}
