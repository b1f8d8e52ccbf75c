//! The search for the first model part among the files of a 3MF package: the one that the package's
//! relationships name, or the one at the usual path, or the first with the extension `.model`.

use crate::import::bundle::BundleFile;

/// The relationship of a package to its first model.
const MODEL_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/// The usual path of that part.
const MODEL_PATH: &str = "3d/3dmodel.model";
/// Most bytes of the relationships that are read. Real ones are a few lines.
const RELATIONSHIPS_BYTES_MAX: usize = 1 << 16;

/// The index of the first model part, if the files are an unpacked 3MF package.
pub fn start_part(files: &[BundleFile]) -> Option<usize> {
    let has = |name: &str| files.iter().position(|file| file.path.eq_ignore_ascii_case(name));
    let relationships = has("_rels/.rels");
    if has("[Content_Types].xml").is_none() && relationships.is_none() {
        return None;
    }
    let declared = relationships.and_then(|number| target(&files[number].bytes));
    let declared =
        declared.and_then(|path| has(path.trim_start_matches('/')).filter(|&number| is_model(&files[number])));
    declared.or_else(|| has(MODEL_PATH)).or_else(|| files.iter().position(is_model))
}

fn is_model(file: &BundleFile) -> bool {
    file.extension() == "model"
}

/// The target of the relationship. Read without a parser, because it only selects among the files,
/// and there is a fallback.
fn target(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(RELATIONSHIPS_BYTES_MAX)]);
    let element = text.split('<').find(|element| element.contains(MODEL_TYPE))?;
    let value = element.split_once("Target=")?.1;
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    value[1..].split(quote).next().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_model_is_found() {
        let rels =
            |target: &str| format!("<Relationships><Relationship Target=\"{target}\" Type=\"{MODEL_TYPE}\"/></R>");
        let files = |list: &[(&str, &str)]| -> Vec<BundleFile> {
            list.iter().map(|(name, text)| BundleFile::new(name, text.as_bytes().to_vec()).unwrap()).collect()
        };
        let types = ("[Content_Types].xml", "");
        let declared = rels("/3D/b.model");
        let cases = [
            (files(&[types, ("3D/a.model", ""), ("3D/b.model", ""), ("_rels/.rels", &declared)]), Some(2)),
            (files(&[types, ("3D/a.model", ""), ("3D/3dmodel.model", ""), ("_rels/.rels", "<Rel")]), Some(2)),
            (files(&[types, ("x.txt", ""), ("Metadata/a.MODEL", "")]), Some(2)),
            (files(&[types, ("word/document.xml", ""), ("_rels/.rels", "")]), None),
            (files(&[("3D/3dmodel.model", "")]), None),
        ];
        for (files, expected) in &cases {
            assert_eq!(start_part(files), *expected);
        }
        assert_eq!(cases.len(), 5);
        assert_eq!(target(format!("<R Type='{MODEL_TYPE}' Target=").as_bytes()), None);
    }
}
