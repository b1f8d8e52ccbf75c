//! The removal of code that a pipeline never runs, before a driver sees it: blocks of a shader that begin with
//! `if has(FLAG)` and whose flag is not in the pipeline's key (the features that the pipeline is compiled for).
//!
//! A driver also removes what a constant switches off. But Mesa's first copies functions to each place that calls
//! them, even to places that it then removes. So it would copy the code of texture lookups five times, even for
//! pictures without textures.

use std::collections::HashMap;

use super::reflection::constant;

/// The code without the blocks that begin with `if has(FLAG)`, or `if has(FLAG) && ...`, where the key lacks the flag. What
/// follows `else` stays.
///
/// In shaders/, the first and the last line of such a block hold nothing else, and begin in the same column.
pub fn pruned(source: &str, key: u32) -> String {
    let flags: HashMap<_, _> = source.lines().filter_map(constant).collect();
    let is_off = |flag: &str| flags.get(flag).is_some_and(|bit| key & bit == 0);
    let mut kept = String::with_capacity(source.len());
    // The indentation of the block that is being left out.
    let mut left_out: Option<&str> = None;
    for line in source.lines() {
        let code = line.trim_start();
        let indent = &line[..line.len() - code.len()];
        match left_out {
            Some(of_block) if indent != of_block => continue,
            Some(_) if code == "}" => {}
            Some(_) => match code.strip_prefix("} else ") {
                Some(rest) => kept += rest,
                None => continue,
            },
            None if flag_of_block(code).is_some_and(is_off) => {
                left_out = Some(indent);
                continue;
            }
            None => kept += line,
        }
        left_out = None;
        kept.push('\n');
    }
    kept
}

/// The flag without which the block that a line begins is not run.
fn flag_of_block(code: &str) -> Option<&str> {
    let (flag, rest) = code.strip_prefix("if has(")?.split_once(')')?;
    (code.ends_with('{') && (rest == " {" || rest.starts_with(" && ") && !rest.contains("||"))).then_some(flag)
}
