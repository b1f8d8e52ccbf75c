//! Draws one mesh from many sides: it is read once.
//!
//!     cargo run --release -p meshsnap --example turntable -- api/examples/knot.obj 12 frames/

use std::error::Error;
use std::path::Path;

use meshsnap::{Mesh, Renderer, Spec};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, count, folder] = arguments.as_slice() else {
        return Err("usage: turntable MESH COUNT FOLDER".into());
    };
    let count: u32 = count.parse()?;
    let mesh = Mesh::read(&std::fs::read(input)?)?;
    let style = Spec::outline().size_px(320, 320)?;
    let mut renderer = Renderer::cpu();
    std::fs::create_dir_all(folder)?;
    for frame in 0..count {
        let azimuth_deg = 360.0 * f64::from(frame) / f64::from(count) - 180.0;
        let spec = style.set("camera.azimuth_deg", &azimuth_deg.to_string())?;
        let image = renderer.render(&mesh, &spec)?;
        std::fs::write(Path::new(folder).join(format!("{frame:03}.png")), image.to_png()?)?;
    }
    println!("{count} frames in {folder}");
    Ok(())
}
