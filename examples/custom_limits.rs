//! Draws a file of a stranger under tight limits, and gives up after a time.
//!
//!     cargo run --release -p meshsnap --example custom_limits -- api/examples/knot.obj knot.png

use std::error::Error;
use std::time::Duration;

use meshsnap::{Deadline, Fault, Limits, Mesh, Renderer, Spec, Watch};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        return Err("usage: custom_limits MESH PNG".into());
    };
    let mut limits = Limits::default();
    limits.triangles = 100_000;
    limits.memory_bytes = 256 << 20;
    limits.image_px = 1024;

    // Raised from another thread; whatever is at work then ends with an error.
    let deadline = Deadline::default();
    let flag = deadline.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(2));
        flag.stop();
    });

    match draw(std::fs::read(input)?, &limits, &deadline) {
        Ok(png) => Ok(std::fs::write(output, png)?),
        Err(error) => match error.fault() {
            Fault::Mesh => Err(format!("{input} is refused: {error}").into()),
            Fault::Deadline => Err(format!("{input} takes longer than two seconds").into()),
            _ => Err(error.into()),
        },
    }
}

fn draw(bytes: Vec<u8>, limits: &Limits, deadline: &Deadline) -> Result<Vec<u8>, meshsnap::Error> {
    let mesh = Mesh::reader().file("", bytes).limits(limits.clone()).deadline(deadline).read()?;
    let mut renderer = Renderer::cpu().limits(limits.clone());
    let mut heard = |stage| eprintln!("{stage:?} has ended");
    let watch = Watch::default().deadline(deadline).progress(&mut heard);
    let picture = renderer.picture(&mesh, &Spec::auto().size(512, 512), watch)?;
    Ok(picture.image.to_png()?)
}
