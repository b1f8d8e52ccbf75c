//! Lays the wires of a mesh over pixels of the program's own: here its faces, each in a colour of its own and darker with
//! distance.
//!
//!     cargo run --release -p meshsnap --example overlay -- api/examples/knot.obj overlay.png

use std::error::Error;

use meshsnap::{FaceBuffer, Image, Mesh, Renderer, Spec, Watch};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        return Err("usage: overlay MESH PNG".into());
    };
    let mesh = Mesh::read(&std::fs::read(input)?)?;
    let mut renderer = Renderer::cpu();

    // Black lines on white, hidden by the faces before them.
    let spec = Spec::hidden_line().size(512, 512);
    let lines = renderer.render(&mesh, &spec)?;
    let faces = renderer.faces(&mesh, &spec, Watch::default())?;

    let mut pixels = own_pixels(&faces);
    multiply(&mut pixels, &lines);
    let image = Image { width_px: faces.width_px, height_px: faces.height_px, rgba: pixels.into() };
    std::fs::write(output, image.to_png()?)?;
    println!(
        "{output}: {} of {} pixels show a face",
        faces.triangles.iter().filter(|&&id| id != FaceBuffer::NONE).count(),
        faces.triangles.len()
    );
    Ok(())
}

/// R, G, B and A of each pixel.
fn own_pixels(faces: &FaceBuffer) -> Vec<u8> {
    let near = faces.depths.iter().copied().fold(f32::INFINITY, f32::min);
    let far = faces.depths.iter().copied().filter(|depth| depth.is_finite()).fold(near, f32::max);
    let pixel = |(&id, &depth): (&u32, &f32)| match id {
        FaceBuffer::NONE => [255, 255, 255, 255],
        id => {
            let light = 1.0 - 0.6 * (depth - near) / (far - near).max(f32::MIN_POSITIVE);
            let [r, g, b, _] = id.wrapping_mul(0x9E37_79B9).to_le_bytes();
            let channel = |byte: u8| (light * (96.0 + f32::from(byte) * 0.6)) as u8;
            [channel(r), channel(g), channel(b), 255]
        }
    };
    faces.triangles.iter().zip(&faces.depths).flat_map(pixel).collect()
}

/// Multiplies pixels by those of a picture of the same size: white leaves them as they are, black covers them.
fn multiply(pixels: &mut [u8], picture: &Image) {
    for (pixel, &factor) in pixels.iter_mut().zip(picture.rgba.iter()) {
        *pixel = (u32::from(*pixel) * u32::from(factor) / 255) as u8;
    }
}
