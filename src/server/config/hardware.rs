//! A test whether this machine can have a hardware GPU. On Linux it looks at the device nodes under `/dev`, so that
//! no driver is loaded for it. Elsewhere, and where they cannot be listed, the answer is yes.

use std::path::Path;

/// The reason why there cannot be a hardware GPU here; None if there may be one.
///
/// On Linux every driver needs a node under `/dev`, and a container has it only if it was passed
/// in. On other systems only the driver knows.
pub fn why_no_gpu() -> Option<String> {
    if cfg!(target_os = "linux") { why_no_gpu_under(Path::new("/dev")) } else { None }
}

fn why_no_gpu_under(dev: &Path) -> Option<String> {
    // If /dev cannot be listed, only the driver knows.
    let names = |folder: &Path| -> std::io::Result<Vec<String>> {
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned())).collect()
    };
    let nodes = names(dev).ok()?;
    let nvidia =
        |name: &str| name.strip_prefix("nvidia").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let is_gpu = |name: &String| nvidia(name) || name == "dxg";
    let has_render_node = || match names(&dev.join("dri")) {
        Ok(nodes) => nodes.iter().any(|name| name.starts_with("renderD")),
        Err(error) => error.kind() != std::io::ErrorKind::NotFound,
    };
    if nodes.iter().any(is_gpu) || has_render_node() {
        return None;
    }
    let dev = dev.display();
    Some(format!("this machine shows no hardware GPU: there is no {dev}/dri/renderD*, {dev}/nvidia* or {dev}/dxg"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gpu_is_known_by_its_node() {
        let cases: &[(&[&str], bool)] = &[
            (&[], false),
            (&["null", "nvidiactl", "nvidia-uvm", "dri/card0"], false),
            (&["dri/renderD128"], true),
            (&["nvidia0"], true),
            (&["nvidiactl", "nvidia12"], true),
            (&["dxg"], true),
        ];
        let mut checked = 0;
        for (nodes, may_have_one) in cases {
            let dev = tempfile::tempdir().unwrap();
            std::fs::create_dir(dev.path().join("dri")).unwrap();
            for node in *nodes {
                std::fs::write(dev.path().join(node), "").unwrap();
            }
            assert_eq!(why_no_gpu_under(dev.path()).is_none(), *may_have_one, "{nodes:?}");
            checked += 1;
        }
        assert_eq!(checked, 6);
        let empty = tempfile::tempdir().unwrap();
        assert!(why_no_gpu_under(empty.path()).is_some_and(|reason| reason.contains("renderD")));
        assert_eq!(why_no_gpu_under(&empty.path().join("missing")), None);
    }
}
