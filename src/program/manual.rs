//! `meshsnap man`: manual pages, made from the same arguments as the help texts.

use clap::Command;
use clap_mangen::Man;

use super::files;
use crate::error::CliError;

/// The commands that have a page of their own.
pub const COMMANDS: [&str; 9] =
    ["render", "inspect", "check", "diff", "serve", "jobs", "health", "sign", "completions"];

/// Prints the page of a command, or of the program.
pub fn print(mut program: Command, of: Option<&str>) -> Result<(), CliError> {
    program.build();
    let page = match of.and_then(|name| program.find_subcommand(name)) {
        // The name of a page has hyphens where the command has spaces.
        Some(command) => {
            let name = format!("meshsnap-{}", command.get_name());
            Man::new(command.clone().display_name(&name)).title(name.to_uppercase())
        }
        None => Man::new(program).title("MESHSNAP"),
    };
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| CliError::ours(format!("the manual page cannot be made: {error}")))?;
    files::print(&text)
}
