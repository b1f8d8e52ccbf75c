//! The option `--format-in` of `inspect`, `check` and `diff`: the format of a mesh, for files whose bytes do not tell
//! it.

use clap::Args;
use clap::builder::PossibleValuesParser;

use meshsnap_render::import::Format;

/// The format of meshes.
#[derive(Args)]
pub struct FormatArg {
    #[arg(
        long,
        value_name = "FORMAT",
        help = "Format of the mesh, where its bytes do not tell",
        value_parser = PossibleValuesParser::new(Format::names()),
        ignore_case = true
    )]
    format_in: Option<String>,
}

impl FormatArg {
    /// The format that is named. None: it is known by the bytes.
    pub fn format(&self) -> Option<Format> {
        self.format_in.as_deref().and_then(Format::from_name)
    }
}
