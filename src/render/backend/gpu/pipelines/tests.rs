//! Tests of the text of shaders: the `// Uses:` comment of each file names all that the file uses,
//! [reflection](super::reflection) finds the buffers and flags that naga (wgpu's parser of WGSL) finds, and a kernel
//! is valid WGSL with or without the code of each feature.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use wgpu::naga;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

use super::prune::pruned;
use super::reflection::Reflection;
use super::shaders::{FILES, text_of};
use super::{Access, Kernel, SampleTarget, SampleWrite, Slot, key};
use crate::backend::gpu::schedule::WORKGROUP;
use crate::backend::gpu::schedule::line_shares::LINE_THREADS;

/// Every kernel in each of its variants.
fn kernels() -> Vec<Kernel> {
    let mut all = vec![
        Kernel::Transform,
        Kernel::Clip,
        Kernel::Grid,
        Kernel::Gather,
        Kernel::Composite,
        Kernel::Shade,
        Kernel::Edge,
        Kernel::Coverage,
    ];
    all.extend([Kernel::Holes, Kernel::Tips, Kernel::Fringes, Kernel::LineLight, Kernel::Resolve, Kernel::Paint]);
    all.extend([Kernel::Breaks, Kernel::Thin, Kernel::MixedPixels, Kernel::MixedColor]);
    all.extend([Kernel::MixedParts, Kernel::MixedShade, Kernel::MixedSum]);
    for write in [SampleWrite::Both, SampleWrite::Depth, SampleWrite::Id] {
        all.push(Kernel::VisibilityFew { write });
        for target in [SampleTarget::Visibility, SampleTarget::Layer, SampleTarget::Points] {
            all.extend([Kernel::Visibility { write, target }, Kernel::VisibilityTile { write, target }]);
        }
    }
    // Lists take depth and id together.
    let (write, target) = (SampleWrite::Both, SampleTarget::Lists);
    all.extend([Kernel::Visibility { write, target }, Kernel::VisibilityTile { write, target }]);
    all
}

/// All kernels, those that gangs share also in the form for gangs.
fn forms() -> impl Iterator<Item = (Kernel, bool)> {
    let shared = kernels().into_iter().filter(|kernel| kernel.is_shared()).map(|kernel| (kernel, true));
    kernels().into_iter().map(|kernel| (kernel, false)).chain(shared)
}

fn parse(kernel: Kernel, is_of_gang: bool) -> naga::Module {
    let source = kernel.source(is_of_gang);
    naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{kernel:?}: {}", error.emit_to_string(&source)))
}

/// All kernels as naga sees them.
pub(crate) fn parsed() -> impl Iterator<Item = (Kernel, naga::Module)> {
    forms().map(|(kernel, is_of_gang)| (kernel, parse(kernel, is_of_gang)))
}

/// Names of slots in the shaders, where these differ from the slots' own names.
const OTHER_NAMES: &[(Slot, &str)] = &[(Slot::PeelLayer, "base")];

#[test]
fn kernels_bind_what_their_code_uses() {
    let mut compared = 0;
    for (kernel, is_of_gang) in forms() {
        let module = parse(kernel, is_of_gang);
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
        let info = validator.validate(&module).unwrap_or_else(|error| panic!("{kernel:?}: {error:?}"));
        let mut used = BTreeMap::new();
        for (handle, global) in module.global_variables.iter() {
            let (Some(at), Some(name)) = (global.binding, global.name.as_deref()) else { continue };
            if at.group == 1 && !info.get_entry_point(0)[handle].is_empty() {
                let naga::AddressSpace::Storage { access } = global.space else { panic!("{name} is no storage") };
                let is_written = access.contains(naga::StorageAccess::STORE);
                used.insert(at.binding, (name, if is_written { Access::ReadWrite } else { Access::Read }));
            }
        }
        let bound = Reflection::of(kernel.entry(), &kernel.source(is_of_gang))
            .buffers
            .into_iter()
            .map(|(slot, access)| (slot as u32, (slot, access)));
        let bound: BTreeMap<u32, (Slot, Access)> = bound.collect();
        assert!(used.keys().eq(bound.keys()), "{kernel:?} uses {used:?} and binds {bound:?}");
        for (binding, (name, access)) in used {
            let (slot, bound_access) = bound[&binding];
            let is_named = snake_case(&format!("{slot:?}")) == name || OTHER_NAMES.contains(&(slot, name));
            assert!(is_named && access == bound_access, "{kernel:?}: {name} is bound as {slot:?}, {bound_access:?}");
            compared += 1;
        }
    }
    assert!(compared > 80, "{compared}");
}

fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

/// The calls in a block: of what, and with which arguments.
fn calls(block: &naga::Block) -> Vec<(naga::Handle<naga::Function>, &[naga::Handle<naga::Expression>])> {
    let of_statement = |statement| match statement {
        &naga::Statement::Call { function, ref arguments, .. } => vec![(function, &arguments[..])],
        naga::Statement::Block(block) => calls(block),
        naga::Statement::If { accept, reject, .. } => [calls(accept), calls(reject)].concat(),
        naga::Statement::Loop { body, continuing, .. } => [calls(body), calls(continuing)].concat(),
        naga::Statement::Switch { cases, .. } => cases.iter().flat_map(|case| calls(&case.body)).collect(),
        _ => Vec::new(),
    };
    block.iter().flat_map(of_statement).collect()
}

/// The entry point and the functions that it calls, however indirectly.
fn called(module: &naga::Module) -> Vec<&naga::Function> {
    let mut functions = vec![&module.entry_points[0].function];
    let (mut next, mut seen) = (0, BTreeSet::new());
    while let Some(function) = functions.get(next).copied() {
        let callees = calls(&function.body).into_iter().map(|(callee, _)| callee);
        functions.extend(callees.filter(|callee| seen.insert(*callee)).map(|callee| &module.functions[callee]));
        next += 1;
    }
    functions
}

#[test]
fn pipelines_are_specialised_by_the_bits_that_their_code_asks_for() {
    let mut asked = 0;
    for (kernel, is_of_gang) in forms() {
        let module = parse(kernel, is_of_gang);
        let has = module.functions.iter().find(|(_, function)| function.name.as_deref() == Some("has")).unwrap().0;
        let mut bits = if is_of_gang { key::GANG } else { 0 };
        for function in called(&module) {
            for (_, arguments) in calls(&function.body).into_iter().filter(|(callee, _)| *callee == has) {
                let flag = match &function.expressions[arguments[0]] {
                    naga::Expression::Constant(constant) => {
                        &module.global_expressions[module.constants[*constant].init]
                    }
                    literal => literal,
                };
                let naga::Expression::Literal(naga::Literal::U32(flag)) = flag else { panic!("{kernel:?}: {flag:?}") };
                bits |= flag;
                asked += 1;
            }
        }
        assert_eq!(kernel.key_bits(is_of_gang), bits, "{kernel:?}");
    }
    assert!(asked > 200, "{asked}");
}

#[test]
fn some_kernel_calls_each_function() {
    let mut uncalled: BTreeSet<(&str, &str)> =
        FILES.iter().flat_map(|(path, text)| functions_of(text).map(move |name| (*path, name))).collect();
    assert!(uncalled.len() > 300, "{}", uncalled.len());
    for (kernel, is_of_gang) in forms() {
        let module = parse(kernel, is_of_gang);
        let called: BTreeSet<_> = called(&module).into_iter().filter_map(|function| function.name.as_deref()).collect();
        for path in kernel.files(is_of_gang) {
            for name in functions_of(text_of(path)).filter(|name| called.contains(name) || *name == kernel.entry()) {
                uncalled.remove(&(path, name));
            }
        }
    }
    assert_eq!(uncalled, BTreeSet::new());
}

fn functions_of(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| line.strip_prefix("fn ")?.split('(').next())
}

#[test]
fn kernels_have_the_files_of_their_variants() {
    for kernel in kernels() {
        let (write, target) = match kernel {
            Kernel::Visibility { write, target } | Kernel::VisibilityTile { write, target } => (write, target),
            Kernel::VisibilityFew { write } => (write, SampleTarget::Visibility),
            _ => continue,
        };
        let files = kernel.files(false);
        let of_variants = [
            ("samples/samples64.wgsl", write == SampleWrite::Both && target != SampleTarget::Lists),
            ("samples/samples32.wgsl", write != SampleWrite::Both),
            ("samples/emit.wgsl", target == SampleTarget::Visibility),
            ("peeling/emit_layer.wgsl", target == SampleTarget::Layer),
            ("mixed/points.wgsl", target == SampleTarget::Points),
            ("mixed/lists.wgsl", target == SampleTarget::Lists),
        ];
        for (file, is_wanted) in of_variants {
            assert_eq!(files.contains(&file), is_wanted, "{kernel:?}: {file}");
        }
    }
    // Gangs share the kernels none of whose files is for one job.
    for kernel in kernels() {
        assert_eq!(kernel.is_shared(), !kernel.files(true).contains(&"one_job.wgsl"), "{kernel:?}");
    }
}

#[test]
fn kernels_have_the_entry_points_and_overrides_that_pipelines_name() {
    for (kernel, module) in parsed() {
        let entries: Vec<_> = module.entry_points.iter().map(|e| (e.name.as_str(), e.workgroup_size)).collect();
        let threads = if kernel == Kernel::Edge { LINE_THREADS } else { WORKGROUP };
        assert_eq!(entries, [(kernel.entry(), [threads, 1, 1])], "{kernel:?}");
        let mut declared: Vec<_> = module.overrides.iter().filter_map(|(_, o)| o.name.as_deref()).collect();
        let mut given: Vec<_> = kernel.constants(0).into_iter().map(|(name, _)| name).collect();
        declared.sort_unstable();
        given.sort_unstable();
        assert_eq!(declared, given, "{kernel:?}");
    }
}

/// Functions of WGSL itself, and its types where they make a value.
const BUILTINS: &[&str] = &[
    "abs",
    "all",
    "any",
    "clamp",
    "countOneBits",
    "dot",
    "exp2",
    "extractBits",
    "f32",
    "firstTrailingBit",
    "floor",
    "i32",
    "log2",
    "max",
    "min",
    "select",
    "sqrt",
    "storageBarrier",
    "u32",
    "u64",
    "unpack2x16float",
    "vec2",
    "vec3",
    "vec4",
    "workgroupBarrier",
    "workgroupUniformLoad",
];

/// A file of shaders/.
struct ShaderFile {
    /// Its text without comments.
    code: String,
    /// Its `// Uses:` comment: files, and the names that each group of them defines for this one.
    uses: Vec<(Vec<String>, Vec<String>)>,
}

/// The files of a folder and its subfolders, by their path below shaders/.
fn shader_files(folder: &Path, prefix: &str, files: &mut BTreeMap<String, ShaderFile>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() {
            shader_files(&path, &format!("{name}/"), files);
        } else {
            let text = std::fs::read_to_string(&path).unwrap();
            let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
            let code = lines.collect::<Vec<_>>().join("\n");
            files.insert(name.clone(), ShaderFile { code, uses: uses_of(&name, &text) });
        }
    }
}

/// The `// Uses:` comment of a shader: `// Uses: a.wgsl (x, y), b.wgsl or c.wgsl (z).` It may take several lines and
/// ends with a full stop. `// Uses: nothing.` is the comment of a file that uses no other.
fn uses_of(name: &str, text: &str) -> Vec<(Vec<String>, Vec<String>)> {
    let head: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//")).map(str::trim).collect();
    let head = head.join(" ");
    let (_, uses) = head.split_once("Uses: ").unwrap_or_else(|| panic!("{name}: no line `// Uses:`"));
    let uses = uses.strip_suffix('.').unwrap_or_else(|| panic!("{name}: `// Uses:` is the end of the head comment"));
    if uses == "nothing" {
        return Vec::new();
    }
    let all = |list: &str, separator: &str| list.split(separator).map(str::to_owned).collect();
    let groups = uses.strip_suffix(')').unwrap_or_else(|| panic!("{name}: {uses}")).split("), ");
    let group = |group: &str| {
        let (files, names) = group.split_once(" (").unwrap_or_else(|| panic!("{name}: {group}"));
        (all(files, " or "), all(names, ", "))
    };
    groups.map(group).collect()
}

/// The identifiers of some code that are neither fields nor attributes, each with the character after it.
fn identifiers(code: &str) -> Vec<(&str, char)> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let (mut rest, mut before) = (code, ' ');
    while let Some(first) = rest.chars().next() {
        let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
        if length > 0 && !first.is_ascii_digit() && before != '.' && before != '@' {
            found.push((&rest[..length], rest[length..].chars().next().unwrap_or(' ')));
        }
        let (taken, after) = rest.split_at(length.max(first.len_utf8()));
        (rest, before) = (after, taken.chars().last().unwrap_or(' '));
    }
    found
}

/// The names that code defines outside of functions.
fn defined_names(code: &str) -> BTreeSet<&str> {
    let of_line = |line| {
        let words = identifiers(line);
        let keyword = words.iter().position(|(word, _)| ["fn", "struct", "const", "override", "var"].contains(word))?;
        // `var<storage, read> name`: the words in angle brackets are no names.
        let is_bracketed = |&&(word, _): &&(&str, char)| {
            ["storage", "uniform", "workgroup", "private", "read", "read_write"].contains(&word)
        };
        words[keyword + 1..].iter().find(|word| !is_bracketed(word)).map(|(name, _)| *name)
    };
    code.lines().filter(|line| !line.starts_with([' ', '}'])).filter_map(of_line).collect()
}

#[test]
fn shaders_say_which_files_they_use() {
    let mut files = BTreeMap::new();
    shader_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "", &mut files);
    assert!(files.len() > 60, "{}", files.len());
    let listed: BTreeSet<_> = FILES.iter().map(|(path, _)| *path).collect();
    assert!(listed.into_iter().eq(files.keys()), "FILES lists all files of shaders/");
    for (name, file) in &files {
        let own = defined_names(&file.code);
        let words = identifiers(&file.code);
        for (others, used) in &file.uses {
            for other in others {
                let Some(other_file) = files.get(other) else { panic!("{name} uses {other}, which does not exist") };
                let defined = defined_names(&other_file.code);
                for word in used {
                    assert!(defined.contains(word.as_str()), "{name} uses {word} of {other}, which has no such name");
                }
            }
            for word in used {
                assert!(words.iter().any(|(other, _)| other == word), "{name} says that it uses {word}, but does not");
            }
        }
        // Functions, and by their capital letters structs and constants. Buffers look like local variables.
        let is_builtin = |word: &str| BUILTINS.contains(&word) || word.starts_with("atomic");
        let is_said = |word: &str| file.uses.iter().any(|(_, used)| used.iter().any(|other| other == word));
        for (word, next) in words {
            let is_global = next == '(' || word.starts_with(|c: char| c.is_ascii_uppercase());
            let is_known = own.contains(word) || is_builtin(word) || is_said(word);
            assert!(!is_global || is_known, "{name} uses {word}: add it to `// Uses:`, with the file that defines it");
        }
    }
}

#[test]
fn blocks_of_flags_that_the_key_lacks_are_left_out() {
    let code = "const A: u32 = 1u;
const B: u32 = 0x2u;
fn f() {
    if has(A) {
        a();
        if has(B) && c {
            b();
        }
    } else {
        d();
    }
    if has(B) || c {
        b();
    }
    if has(A | B) {
        e();
    }
    if has(B) {
        b();
    } else if has(A) {
        a();
    } else {
        d();
    }
}
";
    let without_blanks =
        |key| pruned(code, key).lines().skip(3).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("");
    let rest = "    if has(B) || c {        b();    }    if has(A | B) {        e();    }";
    let last = "if has(A) {        a();    } else {        d();    }}";
    let nested = "        if has(B) && c {            b();        }";
    assert_eq!(without_blanks(0), format!("{{        d();    }}{rest}{last}"));
    assert_eq!(without_blanks(1), format!("    if has(A) {{        a();    }} else {{        d();    }}{rest}{last}"));
    assert_eq!(
        without_blanks(3),
        format!(
            "    if has(A) {{        a();{nested}    }} else {{        d();    }}{rest}    if has(B) {{        b();    }} else {last}"
        )
    );
}

#[test]
fn kernels_are_whole_without_what_any_flag_brings() {
    let (mut cases, mut shorter) = (0, 0);
    for (kernel, is_of_gang) in forms() {
        let bits = kernel.key_bits(is_of_gang);
        let whole = kernel.source_for(bits).len();
        let gang = bits & key::GANG;
        let each = (0..32).map(|bit| 1 << bit).filter(|flag| bits & flag & !gang != 0);
        for key in each.flat_map(|flag| [flag | gang, bits & !flag]).chain([gang]) {
            let source = kernel.source_for(key);
            let module = naga::front::wgsl::parse_str(&source)
                .unwrap_or_else(|error| panic!("{kernel:?}, {key:#x}: {}", error.emit_to_string(&source)));
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
            validator.validate(&module).unwrap_or_else(|error| panic!("{kernel:?}, {key:#x}: {error:?}"));
            cases += 1;
            shorter += usize::from(source.len() < whole);
        }
    }
    assert!(cases > 300 && shorter > cases / 3, "{shorter} of {cases}");
}
