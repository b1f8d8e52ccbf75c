//! The routes: each path, its handlers, and the middleware around them.

use std::sync::Arc;

use axum::Router;
use axum::extract::{DefaultBodyLimit, State};
use axum::middleware::from_fn_with_state;
use axum::response::Response;
use axum::routing::{MethodRouter, get, post};

use super::error::ApiError;
use super::middleware::{auth, cors, observe, rates, site};
use super::resources::verdicts::{check, diff};
use super::resources::{events, health, jobs, meshes, metrics, pages, pictures, render, schema, status};
use super::state::AppState;

/// The router of the whole interface.
pub fn router(state: &Arc<AppState>) -> Router {
    let metrics = Router::new().route("/metrics", get(metrics::get));
    let api = protected_routes()
        .into_iter()
        .fold(metrics, |router, (path, methods)| router.route(path, methods))
        .route_layer(from_fn_with_state(state.clone(), rates::check))
        .route_layer(from_fn_with_state(state.clone(), auth::check))
        .route_layer(from_fn_with_state(state.clone(), site::check));
    let routes = Router::new()
        .route("/", get(pages::front))
        .route("/status", get(pages::status))
        .route("/healthz", get(health::healthz))
        .route("/readyz", get(health::readyz))
        .route("/version", get(health::version))
        .route(schema::OPENAPI_PATH, get(schema::openapi))
        .merge(api)
        .fallback(|| async {
            ApiError::not_found(
                "there is nothing at this path; the work is done at POST /v1/render, and /openapi.json lists the paths",
            )
        });
    // Before keys are asked for: a browser asks without one.
    let routes = match cors::layer(&state.cors_origins) {
        Some(layer) => routes.layer(layer),
        None => routes,
    };
    routes
        // Bodies, forms included, are metered as they are read. The limit of axum, 2 MB, would come
        // before `--limit-body-bytes`.
        .layer(DefaultBodyLimit::disable())
        .layer(from_fn_with_state(state.clone(), observe::observe))
        .with_state(state.clone())
}

/// The routes that need an API key where keys are configured.
fn protected_routes() -> [(&'static str, MethodRouter<Arc<AppState>>); 13] {
    [
        ("/v1/render", post(render::post)),
        ("/v1/check", post(check::post)),
        ("/v1/diff", post(diff::post)),
        ("/v1/meshes", post(meshes::post)),
        ("/v1/meshes/{sha256}", get(meshes::get).put(meshes::put).delete(meshes::delete)),
        // The last segment is `render.png` and so on: the router matches whole segments only.
        ("/v1/meshes/{sha256}/{picture}", get(pictures::get)),
        ("/v1/jobs", post(jobs::post)),
        ("/v1/jobs/{id}", get(jobs::get).delete(jobs::delete)),
        ("/v1/jobs/{id}/result", get(jobs::result)),
        ("/v1/jobs/{id}/events", get(events::get)),
        (schema::PATH, get(schema::get)),
        ("/v1/capabilities", get(capabilities)),
        ("/v1/status", get(status::get)),
    ]
}

/// This handler stands here because it lists the routes.
async fn capabilities(State(state): State<Arc<AppState>>) -> Response {
    let routes = protected_routes().into_iter();
    let paths = routes.map(|(path, _)| path.replace("{picture}", "render.{png|webp|jpg}")).collect();
    health::capabilities(&state, paths)
}
