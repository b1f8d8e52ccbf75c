use std::future::pending;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::backend::{BackendKind, DrawTimes};
use crate::image::ImageFormat;
use crate::service::jobs::Timings;

fn picture(bytes: usize) -> Arc<Finished> {
    Arc::new(Finished {
        picture: vec![7; bytes].into(),
        format: ImageFormat::Png,
        backend: BackendKind::Cpu,
        warnings: Vec::new(),
        selection: None,
        timings: Timings::default(),
        draw_times: DrawTimes::default(),
    })
}

#[tokio::test]
async fn the_next_one_draws_where_the_first_fails_or_hangs_up() {
    let pictures = Arc::new(Pictures::new(1 << 20));
    // Hangs up while it draws.
    let gone = tokio::spawn({
        let pictures = pictures.clone();
        async move { pictures.find("a", pending::<Result<_, ()>>()).await }
    });
    tokio::task::yield_now().await;
    let waits = tokio::spawn({
        let pictures = pictures.clone();
        async move { pictures.find("a", async { Err::<Arc<Finished>, _>("no paint") }).await }
    });
    tokio::task::yield_now().await;
    gone.abort();
    assert_eq!(waits.await.unwrap().unwrap_err(), "no paint");
    let found = pictures.find("a", async { Ok::<_, ()>(picture(10)) }).await.unwrap();
    assert_eq!(found.source, Source::Miss);
    let again = pictures.find("a", async { Err(()) }).await.unwrap();
    assert_eq!((again.source, again.finished.picture.len()), (Source::Hit, 10));
}

#[tokio::test]
async fn what_is_too_large_is_drawn_and_not_kept() {
    let pictures = Pictures::new(10_000);
    let drawn = AtomicUsize::new(0);
    for _ in 0..2 {
        let draw = async {
            drawn.fetch_add(1, Ordering::Relaxed);
            Ok::<_, ()>(picture(20_000))
        };
        assert_eq!(pictures.find("a", draw).await.unwrap().source, Source::Miss);
        for i in 0..40 {
            pictures.find(&i.to_string(), async { Ok::<_, ()>(picture(500)) }).await.unwrap();
            assert!(pictures.load().bytes <= 10_000, "{:?}", pictures.load());
        }
    }
    assert!(drawn.into_inner() == 2 && pictures.load().count > 2, "{:?}", pictures.load());
}
