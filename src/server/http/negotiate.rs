//! Reads the preferences of a client: the form of the answer (`Accept`), and whether and how long
//! it waits for one (`Prefer`).
//!
//! `Accept` is read by hand. The crate `headers` does not read it, and `headers-accept` differs in
//! two ways: of forms that a client accepts equally it takes the client's first and not ours, and
//! one malformed range makes it drop the header.

use std::time::Duration;

use axum::http::{HeaderMap, header};

use super::dto::media_type;
use super::error::{ApiError, ErrorKind};
use crate::jobs::Media;
use meshsnap_render::image::ImageFormat;

/// The forms of pictures, best first: of those that a client accepts equally, the first is taken.
const PICTURES: [Media; 3] =
    [Media::Picture(ImageFormat::Png), Media::Picture(ImageFormat::Webp), Media::Picture(ImageFormat::Jpeg)];

/// JSON, and then the forms of pictures.
const ALL: [Media; 4] = [Media::Json, PICTURES[0], PICTURES[1], PICTURES[2]];

/// Longest wait that a client can set: proxies often end a request after a minute.
const WAIT_S_MAX: u64 = 60;

/// The picture's format: the one in the document, else the best acceptable one, else PNG.
pub fn image_format(requested: Option<ImageFormat>, headers: &HeaderMap) -> Result<ImageFormat, ApiError> {
    if let Some(format) = requested {
        return Ok(format);
    }
    best(&PICTURES, headers)
        .map(|media| picture_format(media).unwrap_or(ImageFormat::Png))
        .ok_or_else(|| not_acceptable("the Accept header allows none of image/png, image/webp and image/jpeg"))
}

/// JSON (None), or else a picture of the format that the client likes better.
pub fn json_or_image(headers: &HeaderMap) -> Result<Option<ImageFormat>, ApiError> {
    best(&ALL, headers).map(picture_format).ok_or_else(|| {
        not_acceptable("the Accept header allows none of application/json, image/png, image/webp and image/jpeg")
    })
}

fn picture_format(media: Media) -> Option<ImageFormat> {
    match media {
        Media::Picture(format) => Some(format),
        Media::Json => None,
    }
}

fn not_acceptable(detail: &str) -> ApiError {
    ApiError::new(ErrorKind::NotAcceptable, "not_acceptable", detail).header(header::VARY, "accept")
}

/// The form that a client accepts best. None if it accepts none.
fn best(forms: &[Media], headers: &HeaderMap) -> Option<Media> {
    let accept: Vec<&str> = headers.get_all(header::ACCEPT).iter().filter_map(|v| v.to_str().ok()).collect();
    if accept.iter().all(|line| line.trim().is_empty()) {
        return forms.first().copied();
    }
    let ranges: Vec<(&str, f32)> = accept.iter().flat_map(|line| line.split(',')).filter_map(range).collect();
    let mut best: Option<(Media, (f32, u8))> = None;
    for &form in forms {
        let score = quality(media_type(form), &ranges);
        if score.0 > 0.0 && best.is_none_or(|(_, best)| score > best) {
            best = Some((form, score));
        }
    }
    best.map(|(form, _)| form)
}

/// A media range and its quality. None if it is malformed.
fn range(text: &str) -> Option<(&str, f32)> {
    let mut parts = text.split(';').map(str::trim);
    let name = parts.next().filter(|name| name.contains('/'))?;
    let q = parts.find_map(|p| p.strip_prefix("q=").or_else(|| p.strip_prefix("Q=")));
    let q = q.map_or(Some(1.0), |q| q.parse::<f32>().ok())?;
    (0.0..=1.0).contains(&q).then_some((name, q))
}

/// The quality of a media type, which is that of the most specific range that matches it, and how specific that is:
/// a browser that names image/webp beside `image/*` likes it best.
fn quality(media_type: &str, ranges: &[(&str, f32)]) -> (f32, u8) {
    let specificity = |name: &str| match name {
        _ if name.eq_ignore_ascii_case(media_type) => Some(2),
        _ if name.strip_suffix("/*").is_some_and(|kind| is_of_kind(media_type, kind)) => Some(1),
        "*/*" => Some(0),
        _ => None,
    };
    let matching = ranges.iter().filter_map(|&(name, q)| specificity(name).map(|s| (s, q)));
    matching.max_by_key(|&(s, _)| s).map_or((0.0, 0), |(s, q)| (q, s))
}

fn is_of_kind(media_type: &str, kind: &str) -> bool {
    media_type.split('/').next().is_some_and(|own| own.eq_ignore_ascii_case(kind))
}

/// The preferences in `Prefer`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Prefer {
    /// An answer of 202 at once, instead of the picture later.
    pub respond_async: bool,
    /// Longest time to wait for the end of a job.
    pub wait: Option<Duration>,
}

/// Reads every `Prefer` header. Unknown preferences are ignored, as RFC 7240 demands.
pub fn prefer(headers: &HeaderMap) -> Prefer {
    let mut prefer = Prefer::default();
    let lines = headers.get_all("prefer").iter().filter_map(|v| v.to_str().ok());
    for preference in lines.flat_map(|line| line.split([',', ';'])).map(str::trim) {
        if preference.eq_ignore_ascii_case("respond-async") {
            prefer.respond_async = true;
        } else if let Some((name, value)) = preference.split_once('=')
            && name.trim().eq_ignore_ascii_case("wait")
            && let Ok(seconds) = value.trim().trim_matches('"').parse::<u64>()
        {
            prefer.wait = Some(Duration::from_secs(seconds.min(WAIT_S_MAX)));
        }
    }
    prefer
}

/// True if the answer depends on `Accept`.
pub fn depends_on_accept(requested: Option<ImageFormat>) -> bool {
    requested.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accept(value: &'static str) -> Option<ImageFormat> {
        let headers = HeaderMap::from_iter([(header::ACCEPT, value.parse().unwrap())]);
        image_format(None, &headers).ok()
    }

    #[test]
    fn the_best_acceptable_format_is_taken() {
        use ImageFormat::{Jpeg, Png, Webp};
        let cases = [
            ("*/*", Some(Png)),
            ("image/*", Some(Png)),
            ("image/webp", Some(Webp)),
            ("image/jpeg;q=0.5, image/webp;q=0.4", Some(Jpeg)),
            ("text/html,application/xhtml+xml,image/avif,image/webp,*/*;q=0.8", Some(Webp)),
            ("image/png;q=0, */*", Some(Webp)),
            ("image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8", Some(Webp)),
            ("image/avif,image/webp,image/png,image/svg+xml,image/*;q=0.8,*/*;q=0.5", Some(Png)),
            ("IMAGE/PNG", Some(Png)),
            ("text/html", None),
            ("image/png;q=0", None),
            ("image/png;q=nan", None),
            ("application/problem+json", None),
            ("", Some(Png)),
        ];
        for (value, expected) in cases {
            assert_eq!(accept(value), expected, "{value}");
        }
        assert_eq!(image_format(None, &HeaderMap::new()).ok(), Some(Png));
        assert_eq!(
            image_format(Some(Jpeg), &HeaderMap::from_iter([(header::ACCEPT, "text/html".parse().unwrap())])).ok(),
            Some(Jpeg)
        );
    }

    #[test]
    fn preferences_are_found_among_others() {
        let read =
            |value: &'static str| prefer(&HeaderMap::from_iter([("prefer".parse().unwrap(), value.parse().unwrap())]));
        assert!(read("respond-async, wait=5").respond_async);
        assert_eq!(read("respond-async; wait=5").wait, Some(Duration::from_secs(5)));
        assert_eq!(read("wait=99999").wait, Some(Duration::from_secs(60)));
        assert_eq!(read("wait=-1, handling=lenient"), Prefer::default());
    }
}
