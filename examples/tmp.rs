use meshsnap::{
    backend::{Renderer, cpu::*},
    limits::*,
    mesh::*,
    plan,
    scene::*,
};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut b = Budget::new(&Limits::default());
    let bytes = std::fs::read(&a[1]).unwrap();
    let t = std::time::Instant::now();
    let m = match import(&bytes, None, &Limits::default(), &mut b, &Deadline::default()) {
        Ok(m) => m,
        Err(e) => {
            eprintln!("{} {e:?}", a[1]);
            return;
        }
    };
    eprint!("import {:?} ", t.elapsed());
    let style = &a[2];
    let threads: usize = a[4].parse().unwrap();
    let px = a.get(5).map_or(512, |s| s.parse().unwrap());
    let surf = Surface {
        shading: if style == "outline" || style == "smooth" { Shading::Smooth } else { Shading::Flat },
        color: None,
        metallic: 0.,
        roughness: 0.6,
        cull: Cull::None,
    };
    let wire = Wire {
        method: if style == "fwidth" { WireMethod::Fwidth } else { WireMethod::Exact },
        color: color::Rgba::BLACK,
        thickness: 1.,
        smoothing: if style == "fwidth" { 1. } else { 0. },
        opacity: 1.,
        edges: if style == "poly" { WireEdges::Polygons } else { WireEdges::Triangles },
        hidden: if style == "wireframe" { Hidden::Show } else { Hidden::Hide },
    };
    let spec = Spec {
        surface: (style != "wireframe").then_some(surf),
        wire: ["wire", "fwidth", "wireframe", "poly"].contains(&style.as_str()).then_some(wire),
        outline: (style == "outline").then_some(Outline {
            color: color::Rgba::BLACK,
            thickness: None,
            unit: OutlineUnit::Object,
        }),
        camera: CameraSpec {
            view: View::Iso,
            azimuth_deg: None,
            elevation_deg: None,
            projection: Projection::Perspective,
            fov_deg: 35.,
            height: None,
            up: None,
            margin: 0.05,
            eye: None,
            target: None,
        },
        light: Light { intensity: 1., ambient: 0.3 },
        image: ImageSpec { width_px: px, height_px: px, format: None, samples: 4, background: color::Rgba::WHITE },
        backend: BackendChoice::Cpu,
    };
    let t = std::time::Instant::now();
    let p = plan::build(&m, &spec, &mut b).unwrap();
    eprint!("plan {:?} ", t.elapsed());
    let mut r = CpuRenderer::new(threads);
    let d = Deadline::default();
    let mut best = f64::MAX;
    let mut img = None;
    for _ in 0..20 {
        let t = std::time::Instant::now();
        img = Some(r.draw(&p, &d).unwrap());
        best = best.min(t.elapsed().as_secs_f64() * 1e3);
    }
    eprintln!("{} {} draw {best:.2} ms", a[1], style);
    let i = img.unwrap();
    image::save_buffer(&a[3], &i.rgba, i.width_px, i.height_px, image::ColorType::Rgba8).unwrap();
}
