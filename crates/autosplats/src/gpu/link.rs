//! Links WGSL: a pass, the files that it imports, and the constants of Rust that they name. See
//! docs/decisions/0018-wgsl-linker.md.

use std::collections::HashSet;

/// Workgroups in a row of a dispatch. More than 65535 need a second dimension, which `shared/groups.wgsl` undoes.
pub(super) const GROUPS_PER_ROW: u32 = 32768;

/// Invocations in a workgroup of passes with much work for each item.
pub(crate) const SMALL_GROUP: u32 = 64;
/// Invocations in a workgroup of most other passes.
pub(crate) const LARGE_GROUP: u32 = 256;

/// Name and text of a WGSL file that others import.
pub(crate) type File = (&'static str, &'static str);

/// The parts that the passes of a stage are made of.
#[derive(Debug)]
pub(crate) struct Library {
    /// Files that passes import by name, beside those of `shared/`.
    pub(crate) files: &'static [&'static [File]],
    /// Constants that passes name.
    pub(crate) constants: &'static [&'static [Constant]],
}

/// A constant of Rust in WGSL.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constant {
    /// The name in Rust. In WGSL, all names are in capitals: `NotFinite` is `NOT_FINITE`.
    pub(crate) name: &'static str,
    /// The value as an expression of WGSL.
    pub(crate) value: fn() -> String,
}

impl Constant {
    /// The declaration in WGSL.
    pub(crate) fn in_wgsl(&self) -> String {
        format!("const {} = {};\n", in_capitals(self.name), (self.value)())
    }
}

/// A list of [`File`]s, in the folder `imports/` beside the Rust file unless another is given.
macro_rules! files {
    (in $folder:literal: $($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!($folder, "/", $name, ".wgsl")))),*]
    };
    ($($name:literal),* $(,)?) => {
        $crate::gpu::files!(in "imports": $($name),*)
    };
}

/// A list of [`Constant`]s: those of a module, or `NAME` and `NAME = value`.
macro_rules! constants {
    (in $module:ident: $($name:ident),* $(,)?) => {
        $crate::gpu::constants![$($name = $module::$name),*]
    };
    ($($name:ident $(= $value:expr)?),* $(,)?) => {
        &[$($crate::gpu::Constant {
            name: stringify!($name),
            value: || $crate::gpu::InWgsl::in_wgsl(&$crate::gpu::constants!(@ $name $($value)?)),
        }),*]
    };
    (@ $name:ident) => { $name };
    (@ $name:ident $value:expr) => { $value };
}

/// An enum whose variants are indices, and constants of WGSL; with `in "Prefix"`, their names begin with it.
macro_rules! indices {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($variants:tt)* }) => {
        $crate::gpu::indices! { $(#[$meta])* $vis enum $name in "" { $($variants)* } }
    };
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident in $prefix:literal { $($(#[$doc:meta])* $variant:ident),* $(,)? }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $name { $($(#[$doc])* $variant),* }

        impl $name {
            /// The variants in WGSL.
            pub(crate) const CONSTANTS: &[$crate::gpu::Constant] = &[$($crate::gpu::Constant {
                name: concat!($prefix, stringify!($variant)),
                value: || $crate::gpu::InWgsl::in_wgsl(&(Self::$variant as u32)),
            }),*];
        }
    };
}

pub(crate) use {constants, files, indices};

/// Files for all stages.
const SHARED: Library = Library {
    files: &[files!(in "../shared":
        "cloud_points", "density", "depth_map", "divide", "drawing_groups", "eigen", "frame", "groups", "half",
        "layers", "lines", "matters", "moved", "names", "neighborhood", "noise", "orthonormal", "past_radii", "picture",
        "project_point", "put_rounds", "put_work", "range_keys", "rank", "reproject", "screen", "sum_before",
        "surfel",
    )],
    constants: &[constants![
        GROUPS_PER_ROW,
        LARGE_GROUP,
        MAX_F32 = f32::MAX,
        MIN_POSITIVE = f32::MIN_POSITIVE,
        NO_POINT = u32::MAX,
        SMALL_GROUP
    ]],
};

/// A value that constants of WGSL may have.
pub(crate) trait InWgsl {
    /// The value as an expression of WGSL, with its type.
    fn in_wgsl(&self) -> String;
}

macro_rules! numbers {
    ($($suffix:literal: $($number:ty),*;)*) => {
        $($(impl InWgsl for $number {
            fn in_wgsl(&self) -> String {
                // The shortest digits that give the same bits when read.
                format!(concat!("{:?}", $suffix), self)
            }
        })*)*
    };
}
numbers! {
    "f": f32;
    "u": u32, usize;
    "i": i32, isize;
}

/// A vector of up to four numbers, else an array.
impl<T: InWgsl, const N: usize> InWgsl for [T; N] {
    fn in_wgsl(&self) -> String {
        let values: Vec<_> = self.iter().map(InWgsl::in_wgsl).collect();
        let kind = if N > 4 { "array".to_owned() } else { format!("vec{N}") };
        format!("{kind}({})", values.join(", "))
    }
}

/// The source of a pass with all its imports and constants.
///
/// The order of declarations has no meaning in WGSL. The pass comes first, so that messages name its lines.
///
/// # Panics
/// If an import is unknown. The tests link every pass.
pub(crate) fn link(source: &str, library: &Library) -> String {
    let mut files = vec![("", source)];
    let mut read = 0;
    while read < files.len() {
        for name in imports(files[read].1) {
            if !files.iter().any(|&(known, _)| known == name) {
                let mut known = SHARED.files.iter().chain(library.files).copied().flatten();
                let file = known.find(|(known, _)| *known == name);
                files.push(*file.unwrap_or_else(|| panic!("no {name}.wgsl to import")));
            }
        }
        read += 1;
    }
    let mut linked: String = files.into_iter().map(|(_, source)| without_imports(source)).collect();
    let words: HashSet<_> = linked.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    let constants = SHARED.constants.iter().chain(library.constants).copied().flatten();
    let named = constants.filter(|constant| words.contains(in_capitals(constant.name).as_str()));
    let declared: String = named.map(Constant::in_wgsl).collect();
    linked.push_str(&declared);
    linked
}

fn imports(source: &str) -> impl Iterator<Item = &str> {
    source.lines().filter_map(|line| line.strip_prefix("#import "))
}

/// The source with empty lines in place of imports.
fn without_imports(source: &str) -> String {
    source.lines().map(|line| if line.starts_with("#import ") { "\n".into() } else { format!("{line}\n") }).collect()
}

/// A name in capitals, with `_` between words: `KRadius` is `K_RADIUS`.
fn in_capitals(name: &str) -> String {
    let mut capitals = String::new();
    for (at, letter) in name.char_indices() {
        let is_lowercase = |letter: Option<char>| letter.is_some_and(|letter| letter.is_lowercase());
        let begins = letter.is_uppercase() && is_lowercase(name[at + 1..].chars().next());
        let follows = letter.is_uppercase() && is_lowercase(name[..at].chars().next_back());
        if at > 0 && (begins || follows) {
            capitals.push('_');
        }
        capitals.push(letter.to_ascii_uppercase());
    }
    capitals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_gets_each_file_once_and_the_constants_that_it_names() {
        const FAR: f32 = -1e-7;
        const LIBRARY: Library = Library {
            files: &[&[("a", "#import b\nfn a() {}"), ("b", "#import a\nfn b() {}"), ("c", "fn c() {}")]],
            constants: &[constants![FAR, SIDES = [8u32, 2], UNUSED = 1u32]],
        };
        let linked = link("#import a\nfn pass() { use(FAR, SIDES, MAX_F32); }", &LIBRARY);
        let expected = "\nfn pass() { use(FAR, SIDES, MAX_F32); }\n\nfn a() {}\n\nfn b() {}\n\
                        const MAX_F32 = 3.4028235e38f;\nconst FAR = -1e-7f;\nconst SIDES = vec2(8u, 2u);\n";
        assert_eq!(linked, expected);
    }

    #[test]
    fn names_in_wgsl_are_in_capitals() {
        for (name, expected) in [("MAX_F32", "MAX_F32"), ("NotFinite", "NOT_FINITE"), ("ShowKRadius", "SHOW_K_RADIUS")]
        {
            assert_eq!(in_capitals(name), expected);
        }
    }
}
