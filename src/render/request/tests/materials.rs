//! Tests of the layers of single materials, which begin from those of the document.

use crate::request::tests::{json, query, rules};
use crate::request::*;
use crate::spec::color::Rgba;
use crate::spec::{Layers, OutlineUnit, Shading};

fn material<'s>(spec: &'s Spec, name: &str) -> &'s Layers {
    &spec.materials.iter().find(|(n, _)| n == name).unwrap().1
}

#[test]
fn materials_begin_from_the_document_wherever_they_stand() {
    let document = r##"{"materials":{"Glass":{"surface":{"opacity":0.3},"outline":null},"Frame":{"wire":{}},"Same":{}},
                        "style":"outline","surface":{"color":"#f00"}}"##;
    let spec = json(document).unwrap();
    let names: Vec<&str> = spec.materials.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["Frame", "Glass", "Same"]);
    let glass = material(&spec, "Glass");
    let surface = glass.surface.unwrap();
    assert_eq!((surface.opacity, surface.color, surface.shading), (0.3, Rgba::parse("f00"), Shading::Smooth));
    assert_eq!((glass.outline, spec.layers.outline.is_some()), (None, true));
    assert!(material(&spec, "Frame").wire.is_some() && spec.layers.wire.is_none());
    assert_eq!(material(&spec, "Same"), &spec.layers);
    // An override of the document affects its materials too; one of a material affects only that
    // material.
    let over = [("materials.Glass.surface.opacity", "0.5"), ("surface.color", "0f0"), ("materials.Frame.wire", "null")];
    let over = over.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let spec = read(Some(document.as_bytes()), &over, &rules()).unwrap();
    let surface = material(&spec, "Glass").surface.unwrap();
    assert_eq!((surface.opacity, surface.color), (0.5, Rgba::parse("0f0")));
    assert!(material(&spec, "Frame").wire.is_none());
}

#[test]
fn materials_names_may_be_anything() {
    let spec = query(&[("materials.Glass.v2.1.surface.opacity", "0.3"), ("materials..wire", "{}")]).unwrap();
    assert_eq!(material(&spec, "Glass.v2.1").surface.unwrap().opacity, 0.3);
    assert!(material(&spec, "").wire.is_some());
    let spec = json(r#"{"materials":{"a.b.surface":{"wire":{}},"wire":{"surface":null},"\u00e9\u0000":{}}}"#).unwrap();
    assert!(material(&spec, "a.b.surface").wire.is_some());
    assert!(material(&spec, "wire").surface.is_none());
    assert_eq!(material(&spec, "\u{e9}\0"), &spec.layers);
}

#[test]
fn dependent_defaults_and_limits_are_settled_for_each_material() {
    let document = r#"{"style":"wire","materials":{"A":{"wire":{"method":"fwidth"}},"B":{"wire":{"color":"f00"}}}}"#;
    let spec = json(document).unwrap();
    let smoothing = |name| material(&spec, name).wire.unwrap().smoothing;
    assert_eq!((smoothing("A"), smoothing("B")), (1.0, 0.0));
    let document = r#"{"wire":{"smoothing":0.5},"materials":{"A":{"wire":{"method":"fwidth"}}}}"#;
    assert_eq!(material(&json(document).unwrap(), "A").wire.unwrap().smoothing, 0.5);
    // Contours may differ in their units; hulls may not.
    let document = r#"{"style":"outline","materials":{"A":{"outline":{"method":"contour","unit":"px"}}}}"#;
    assert_eq!(material(&json(document).unwrap(), "A").outline.unwrap().unit, OutlineUnit::Px);
}

#[test]
fn materials_share_what_one_picture_can_do_in_one_way() {
    let hidden = r#"{"style":"wire","wire":{"method":"fwidth"},"materials":{"A":{"wire":{"hidden":"fade"}}}}"#;
    let error = json(hidden).unwrap_err();
    assert_eq!((error.fault, error.key.as_str()), (RequestFault::Conflict, "materials.A.wire.hidden"));
    // Exact wires may differ, up to a limit.
    let many = |count: usize| {
        let wires: Vec<_> = (0..count).map(|i| format!(r#""M{i}":{{"wire":{{"thickness":{}}}}}"#, i + 1)).collect();
        json(&format!(r#"{{"materials":{{{}}}}}"#, wires.join(",")))
    };
    assert_eq!(many(64).unwrap().materials.len(), 64);
    let error = many(65).unwrap_err();
    assert_eq!((error.fault, error.key.as_str()), (RequestFault::Conflict, "materials"));
    assert!(error.to_string().contains("64"), "{error}");
}
