//! Draws a mesh file into a PNG file.
//!
//!     cargo run --release -p meshsnap --example thumbnail -- api/examples/knot.obj knot.png

use std::error::Error;

use meshsnap::{Mesh, Renderer, Spec};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        return Err("usage: thumbnail MESH PNG".into());
    };
    let mesh = Mesh::read(&std::fs::read(input)?)?;
    for warning in mesh.warnings() {
        eprintln!("{}: {}", warning.code, warning.detail);
    }
    let spec = Spec::wire().size_px(256, 256)?.set("background", "transparent")?;
    let image = Renderer::auto().render(&mesh, &spec)?;
    std::fs::write(output, image.to_png()?)?;
    println!("{output}: {} triangles, {} x {} px", mesh.triangle_count(), image.width_px, image.height_px);
    Ok(())
}
