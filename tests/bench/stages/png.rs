//! PNG of the pictures in some folders, beside the plain way: Paeth for every row, and a code that
//! fits no picture in particular.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use meshsnap::encode;
use meshsnap::image::{Image, ImageFormat};
use meshsnap::limits::Deadline;
use meshsnap::spec::DEFAULT_EFFORT;

/// Bytes of a PNG beside its compressed rows: signature, header, end, and the frame of the data.
const FRAME_BYTES: usize = 57;

/// Prints a line for each picture.
pub fn print(folders: &[String], rounds: usize) {
    println!("| picture | bytes | of the plain way | ms | MB/s |\n|---|---|---|---|---|");
    let (mut count, mut worst, mut sums) = (0, 0.0_f64, [0, 0]);
    for path in folders.iter().flat_map(|folder| pictures(Path::new(folder))) {
        let decoded = image::open(&path).unwrap().to_rgba8();
        let (width_px, height_px) = decoded.dimensions();
        let image = Image { width_px, height_px, rgba: decoded.into_raw() };
        let encoded = || encode::encode(&image, ImageFormat::Png, DEFAULT_EFFORT, &Deadline::default()).unwrap();
        let file = encoded();
        let back = image::load_from_memory(&file).unwrap().to_rgba8();
        assert!(back.as_raw() == &image.rgba, "{path:?} comes back");
        let ms = (0..rounds).map(|_| ms(|| black_box(encoded()))).fold(f64::INFINITY, f64::min);
        let plain = FRAME_BYTES + fdeflate::compress_to_vec(&paeth_rows(&image)).len();
        let ratio = file.len() as f64 / plain as f64;
        let rate = image.rgba.len() as f64 / 1e3 / ms;
        println!("| {} | {} | {ratio:.3} | {ms:.3} | {rate:.0} |", path.file_name().unwrap().display(), file.len());
        (count, worst) = (count + 1, worst.max(ratio));
        sums = [sums[0] + file.len(), sums[1] + plain];
    }
    println!(
        "\n{count} pictures: {} bytes, {:.3} of the plain way; at most {worst:.3}",
        sums[0],
        sums[0] as f64 / sums[1] as f64
    );
}

fn ms<T>(run: impl FnOnce() -> T) -> f64 {
    let began = Instant::now();
    run();
    began.elapsed().as_secs_f64() * 1e3
}

/// The PNG files of a folder, by name.
fn pictures(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{folder:?}: {error}"));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "png"));
    paths.sort();
    paths
}

/// The rows filtered by Paeth, without alpha if all pixels are opaque.
fn paeth_rows(image: &Image) -> Vec<u8> {
    let channels = if image.is_opaque() { 3 } else { 4 };
    let row_len = image.width_px as usize * 4;
    let mut rows = Vec::new();
    let mut above = vec![0; row_len];
    for row in image.rgba.chunks_exact(row_len) {
        rows.push(4);
        for i in (0..row_len).filter(|i| i % 4 < channels) {
            let left = |row: &[u8]| i32::from(if i < 4 { 0 } else { row[i - 4] });
            let [a, b, c] = [left(row), i32::from(above[i]), left(&above)];
            let by_distance = |v: &i32| (a + b - c - v).abs();
            let nearest = [a, b, c].into_iter().min_by_key(by_distance).unwrap();
            rows.push(row[i].wrapping_sub(nearest as u8));
        }
        above.copy_from_slice(row);
    }
    rows
}
