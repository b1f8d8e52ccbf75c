//! A route of a web service of your own that draws what is posted: `meshsnap-cli` is a whole service, this is a start for one
//! that does something else besides.
//!
//!     cargo run --release -p meshsnap --example axum_route
//!     curl --data-binary @api/examples/knot.obj http://127.0.0.1:8081/thumbnail -o knot.png

use std::error::Error;

use axum::Router;
use axum::body::Bytes;
use axum::extract::DefaultBodyLimit;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use meshsnap::{Fault, Mesh, Renderer, Spec};

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let router = Router::new().route("/thumbnail", post(thumbnail)).layer(DefaultBodyLimit::max(16 << 20));
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:8081".to_owned());
    let listener = tokio::net::TcpListener::bind(address).await?;
    println!("listening on {}", listener.local_addr()?);
    Ok(axum::serve(listener, router).await?)
}

async fn thumbnail(body: Bytes) -> Response {
    // Drawing takes a thread for some milliseconds, so it does not belong on the runtime's own.
    match tokio::task::spawn_blocking(move || draw(&body)).await {
        Ok(Ok(png)) => ([(header::CONTENT_TYPE, "image/png")], png).into_response(),
        Ok(Err(error)) if matches!(error.fault(), Fault::Mesh | Fault::Request) => {
            (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response()
        }
        Ok(Err(_)) | Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

fn draw(bytes: &[u8]) -> Result<Vec<u8>, meshsnap::Error> {
    let mesh = Mesh::read(bytes)?;
    let image = Renderer::cpu().render(&mesh, &Spec::auto().size(256, 256))?;
    Ok(image.to_png()?)
}
