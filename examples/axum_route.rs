//! A route of a web service of your own that draws what is posted. (`meshsnap-cli` is a whole service; this is a start for one
//! that does something else besides.)
//!
//!     cargo run --release -p meshsnap --example axum_route
//!     curl --data-binary @api/examples/knot.obj http://127.0.0.1:8081/thumbnail -o knot.png

use std::error::Error;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use meshsnap::{Fault, Mesh, Renderer, Spec};
use tokio::sync::oneshot;

/// Meshes that wait at most; more are refused.
const WAITING_MAX: usize = 64;

/// A mesh to draw, and the way back to who waits for its picture.
struct Job {
    body: Bytes,
    answer: oneshot::Sender<Result<Vec<u8>, meshsnap::Error>>,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    // A renderer stays on its thread, and keeps its buffers from picture to picture.
    let (jobs, waiting) = sync_channel(WAITING_MAX);
    std::thread::spawn(|| draw_all(waiting));
    let router = Router::new().route("/thumbnail", post(thumbnail));
    let router = router.layer(DefaultBodyLimit::max(16 << 20)).with_state(jobs);
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:8081".to_owned());
    let listener = tokio::net::TcpListener::bind(address).await?;
    println!("listening on {}", listener.local_addr()?);
    Ok(axum::serve(listener, router).await?)
}

async fn thumbnail(State(jobs): State<SyncSender<Job>>, body: Bytes) -> Response {
    let (answer, drawn) = oneshot::channel();
    if jobs.try_send(Job { body, answer }).is_err() {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    }
    match drawn.await {
        Ok(Ok(png)) => ([(header::CONTENT_TYPE, "image/png")], png).into_response(),
        Ok(Err(error)) if matches!(error.fault(), Fault::Mesh | Fault::Request) => {
            (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response()
        }
        Ok(Err(_)) | Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

fn draw_all(jobs: Receiver<Job>) {
    let mut renderer = Renderer::cpu();
    for Job { body, answer } in jobs {
        // Who has gone away meanwhile does not hear of it.
        let _ = answer.send(draw(&mut renderer, &body));
    }
}

fn draw(renderer: &mut Renderer, bytes: &[u8]) -> Result<Vec<u8>, meshsnap::Error> {
    let mesh = Mesh::read(bytes)?;
    let image = renderer.render(&mesh, &Spec::auto().size(256, 256))?;
    Ok(image.to_png()?)
}
