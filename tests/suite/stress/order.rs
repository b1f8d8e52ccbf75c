//! The order of faces, vertices and corners in a file and the winding of its faces change no pixel.
//! Of outlines two pixels, and of wireframes one, may differ by 1/255.

use meshsnap_render::image::Image;

use crate::oracle::obj::Shape;
use crate::support::families::moved::{LOOKS, MESHES, differing, draw, is_blank, shape};
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{cases, renderers};

fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for i in (1..items.len()).rev() {
        items.swap(i, (random.next() % (i as u64 + 1)) as usize);
    }
}

fn flipped(mut shape: Shape) -> Shape {
    shape.polygons.iter_mut().for_each(|p| p.reverse());
    shape
}

fn with_faces_shuffled(mut shape: Shape, random: &mut Random) -> Shape {
    shuffle(&mut shape.polygons, random);
    shape
}

fn renumbered(shape: &Shape, random: &mut Random) -> Shape {
    let mut order: Vec<usize> = (0..shape.vertices.len()).collect();
    shuffle(&mut order, random);
    let mut new_of_old = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, &old)| new_of_old[old] = new);
    Shape {
        vertices: order.iter().map(|&old| shape.vertices[old]).collect(),
        polygons: shape.polygons.iter().map(|p| p.iter().map(|&v| new_of_old[v]).collect()).collect(),
    }
}

/// Every face begun at another corner.
fn turned(mut shape: Shape, random: &mut Random) -> Shape {
    shape.polygons.iter_mut().for_each(|p| p.rotate_left((random.next() % 3) as usize));
    shape
}

/// The largest difference of two pictures' bytes.
fn largest(a: &Image, b: &Image) -> i16 {
    a.rgba.iter().zip(&b.rgba).map(|(a, b)| (i16::from(*a) - i16::from(*b)).abs()).max().unwrap_or(0)
}

fn others(shape: &Shape, random: &mut Random) -> Vec<(&'static str, Shape)> {
    let all = flipped(renumbered(&turned(with_faces_shuffled(shape.clone(), random), random), random));
    vec![
        ("flipped", flipped(shape.clone())),
        ("faces shuffled", with_faces_shuffled(shape.clone(), random)),
        ("vertices renumbered", renumbered(shape, random)),
        ("corners turned", turned(shape.clone(), random)),
        ("all of it", all),
    ]
}

#[test]
fn order_and_winding_leave_no_trace() {
    let (mut compared, mut wanted) = (0, 0);
    let mut wrong = Vec::new();
    let mut random = Random(61);
    let mut renderers = renderers();
    for (number, (name, obj)) in MESHES.into_iter().enumerate() {
        // Triangles, because a polygon's corners decide how it is cut.
        let original = shape(&obj()).triangulated();
        let first = scenes::mesh(&original.text());
        let wants: Vec<Vec<Image>> = LOOKS
            .iter()
            .map(|(_, keys)| renderers.iter_mut().map(|r| draw(&first, keys, "128x96", r.as_mut())).collect())
            .collect();
        for _ in 0..cases(1, 20) {
            // Another single change for each mesh and all of them together; each change in a long run.
            let others = others(&original, &mut random).into_iter().enumerate();
            for (_, (how, other)) in others.filter(|(i, _)| *i == 4 || cases(*i == number % 4, true)) {
                let other = scenes::mesh(&other.text());
                for ((look, keys), wants) in LOOKS.iter().zip(&wants) {
                    for (renderer, want) in renderers.iter_mut().zip(wants) {
                        let got = draw(&other, keys, "128x96", renderer.as_mut());
                        assert!(!is_blank(want), "{name}, {look}");
                        let count = differing(want, &got);
                        // A triangle's depths round by its first corner, and occlusion rounds to 1/255. A stroke's
                        // area rounds by the end of its edge that the file names first.
                        let allowed = match *look {
                            "hull" | "contour" => 2,
                            "wireframe" => 1,
                            _ => 0,
                        };
                        let most = largest(want, &got);
                        if count > allowed || most > i16::from(count > 0) {
                            let kind = renderer.kind().name();
                            wrong.push(format!("{name}, {how}, {look}, {kind}: {count} pixels, by up to {most}"));
                        }
                        compared += 1;
                    }
                }
                wanted += 1;
            }
        }
    }
    assert_eq!(compared, wanted * LOOKS.len() * renderers.len());
    assert!(wrong.is_empty(), "{} of {compared} differ:\n{}", wrong.len(), wrong.join("\n"));
}
