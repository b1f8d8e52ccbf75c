use std::future::pending;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::jobs::{Media, Timings};
use crate::memory::Memory;
use meshsnap_render::backend::{BackendKind, DrawTimes};
use meshsnap_render::image::ImageFormat;

fn picture(bytes: usize) -> Arc<Finished> {
    Arc::new(Finished {
        content: vec![7; bytes].into(),
        memory: None,
        media: Media::Picture(ImageFormat::Png),
        has_failed: false,
        backend: BackendKind::Cpu,
        is_substitute: false,
        warnings: Vec::new(),
        selection: None,
        mesh_was_kept: false,
        timings: Timings::default(),
        draw_times: DrawTimes::default(),
    })
}

/// A request that draws for ever, or until it is aborted.
fn endless(pictures: &Arc<Pictures>) -> tokio::task::JoinHandle<Result<FoundPicture, &'static str>> {
    let pictures = pictures.clone();
    tokio::spawn(async move { pictures.find("a", pending()).await })
}

#[tokio::test]
async fn the_others_draw_for_themselves_where_the_first_fails_or_hangs_up() {
    let pictures = Arc::new(Pictures::new(1 << 20, &Memory::unlimited(&[])));
    let gone = endless(&pictures);
    tokio::task::yield_now().await;
    let others: Vec<_> = (0..3)
        .map(|i| {
            let pictures = pictures.clone();
            tokio::spawn(async move {
                let drawn = if i == 1 { Err("no paint") } else { Ok((picture(10), Source::Miss)) };
                pictures.find("a", async { drawn }).await.map(|found| found.source)
            })
        })
        .collect();
    tokio::task::yield_now().await;
    gone.abort();
    let mut sources = Vec::new();
    for other in others {
        sources.push(other.await.unwrap());
    }
    assert_eq!(sources, [Ok(Source::Miss), Err("no paint"), Ok(Source::Miss)]);
    // Nothing is left of them: the next one is the first again.
    assert!(pictures.locked().is_empty());
    let found = pictures.find("a", async { Ok::<_, ()>((picture(10), Source::Miss)) }).await.unwrap();
    assert_eq!(found.source, Source::Miss);
    let again = pictures.find("a", async { Err(()) }).await.unwrap();
    assert_eq!((again.source, again.finished.content.len()), (Source::Hit, 10));
}

#[tokio::test]
async fn those_who_wait_get_the_first_ones_picture() {
    let pictures = Arc::new(Pictures::new(0, &Memory::unlimited(&[])));
    let (paint, dries) = tokio::sync::oneshot::channel::<()>();
    let first = tokio::spawn({
        let pictures = pictures.clone();
        async move {
            let draw = async {
                dries.await.unwrap();
                Ok::<_, ()>((picture(10), Source::Miss))
            };
            pictures.find("a", draw).await
        }
    });
    tokio::task::yield_now().await;
    let second = tokio::spawn({
        let pictures = pictures.clone();
        async move { pictures.find("a", async { Err(()) }).await }
    });
    tokio::task::yield_now().await;
    paint.send(()).unwrap();
    let sources = [first.await.unwrap().unwrap().source, second.await.unwrap().unwrap().source];
    assert_eq!(sources, [Source::Miss, Source::Coalesced]);
    assert_eq!(pictures.load().count, 0);
}

#[tokio::test]
async fn a_picture_in_place_of_a_gpus_is_not_kept() {
    let pictures = Pictures::new(1 << 20, &Memory::unlimited(&[]));
    for is_substitute in [true, true, false] {
        let mut drawn = picture(10);
        Arc::get_mut(&mut drawn).unwrap().is_substitute = is_substitute;
        let found = pictures.find("W/a", async { Ok::<_, ()>((drawn, Source::Miss)) }).await.unwrap();
        assert_eq!(found.source, Source::Miss, "{is_substitute}");
    }
    // The CPU drew this one because it was quicker.
    let again = pictures.find("W/a", async { Err(()) }).await.unwrap();
    assert_eq!((again.source, pictures.load().count), (Source::Hit, 1));
}

#[tokio::test]
async fn what_is_too_large_is_drawn_and_not_kept() {
    let pictures = Pictures::new(10_000, &Memory::unlimited(&[]));
    let drawn = AtomicUsize::new(0);
    for _ in 0..2 {
        let draw = async {
            drawn.fetch_add(1, Ordering::Relaxed);
            Ok::<_, ()>((picture(20_000), Source::Miss))
        };
        assert_eq!(pictures.find("a", draw).await.unwrap().source, Source::Miss);
        for i in 0..40 {
            pictures.find(&i.to_string(), async { Ok::<_, ()>((picture(500), Source::Miss)) }).await.unwrap();
            assert!(pictures.load().bytes <= 10_000, "{:?}", pictures.load());
        }
    }
    assert!(drawn.into_inner() == 2 && pictures.load().count > 2, "{:?}", pictures.load());
}
