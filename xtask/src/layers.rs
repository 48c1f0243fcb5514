//! The rules of import, for every crate: no circle closes between rooms, which are the files and folders of one folder,
//! and the stages of a frame use only stages before them. Names are resolved: `crate::Name` counts as the room that
//! `Name` is re-exported from, and so does `super::`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use syn::visit::{self, Visit};

/// The stages of `autosplats` in the order of a frame. Its other rooms come before all stages.
const STAGES: [&str; 8] = ["project", "search", "fit", "normals", "adapt", "splat", "shade", "renderer"];

/// Members of the workspace that are not below `crates`.
const OTHER_CRATES: [&str; 4] = ["quality", "fuzz", "serve", "xtask"];

/// Which room uses which, with one file as the witness of each arrow.
type Arrows = BTreeMap<(String, String), PathBuf>;

/// Checks every crate below `root`.
pub(crate) fn check(root: &Path) -> Result<()> {
    let mut wrong = Vec::new();
    let mut crates: Vec<String> = OTHER_CRATES.map(str::to_owned).to_vec();
    for entry in read_dir(root.join("crates"))? {
        crates.push(format!("crates/{}", entry?.file_name().display()));
    }
    crates.sort();
    for name in crates.iter().map(String::as_str) {
        let house = House::read(&root.join(name).join("src"))?;
        let folders = house.folders();
        if name == "crates/autosplats" {
            wrong.extend(folders.get("").into_iter().flat_map(against_the_frame));
        }
        for (folder, arrows) in &folders {
            for circle in circles(arrows) {
                let within = |room: &String| circle.contains(&room.as_str());
                let files: Vec<_> = arrows
                    .iter()
                    .filter(|((from, to), _)| within(from) && within(to))
                    .map(|((from, to), file)| format!("{from} -> {to} ({})", file.display()))
                    .collect();
                let rooms = circle.join(", ");
                wrong.push(format!("{name}{folder}: a circle of rooms {rooms}:\n    {}", files.join("\n    ")));
            }
        }
        let arrows: usize = folders.values().map(Arrows::len).sum();
        println!("{name}: {} files, {arrows} arrows between rooms", house.files.len());
    }
    ensure!(wrong.is_empty(), "imports against the rules:\n  {}", wrong.join("\n  "));
    Ok(())
}

/// The arrows of `autosplats` that lead from a stage to a later one, or from what is no stage to a stage.
fn against_the_frame(arrows: &Arrows) -> Vec<String> {
    let rank = |name: &str| STAGES.iter().position(|stage| *stage == name);
    let later = |from: &str, to: &str| rank(to).is_some_and(|to| rank(from).is_none_or(|from| to > from));
    arrows
        .iter()
        .filter(|((from, to), _)| later(from, to))
        .map(|((from, to), file)| format!("{} ({from}) uses {to}, against {}", file.display(), STAGES.join(" < ")))
        .collect()
}

/// The sets of rooms that reach each other, each sorted.
fn circles(arrows: &Arrows) -> Vec<Vec<&str>> {
    let mut reached: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (from, to) in arrows.keys() {
        reached.entry(from).or_default().insert(to);
        reached.entry(to).or_default();
    }
    let rooms: Vec<&str> = reached.keys().copied().collect();
    // Warshall: rooms are few.
    for &middle in &rooms {
        let beyond = reached[middle].clone();
        for &from in &rooms {
            if reached[from].contains(middle) {
                reached.get_mut(from).expect("every room is a key").extend(&beyond);
            }
        }
    }
    let mut circles: Vec<Vec<&str>> = Vec::new();
    for &room in &rooms {
        let circle: Vec<&str> = rooms
            .iter()
            .copied()
            .filter(|other| reached[room].contains(other) && reached[other].contains(room))
            .collect();
        if circle.len() > 1 && !circles.contains(&circle) {
            circles.push(circle);
        }
    }
    circles
}

/// The path of a module from the crate's root.
type Module = Vec<String>;

/// A crate's modules, with what each uses and hands on.
struct House {
    /// File, module, and the paths named in it.
    files: Vec<(PathBuf, Module, Vec<Vec<String>>)>,
    /// What a module calls by a name that is defined elsewhere: `use` lines, those that hand a name on among them.
    aliases: BTreeMap<(Module, String), Vec<String>>,
    modules: BTreeSet<Module>,
}

impl House {
    fn read(source: &Path) -> Result<Self> {
        let mut paths = Vec::new();
        collect(source, &mut paths)?;
        // Tests may use what is built on a room.
        let is_test = |path: &PathBuf| {
            let below = path.strip_prefix(source).unwrap_or(path);
            below.iter().any(|part| part == "tests" || part == "tests.rs")
        };
        paths.retain(|path| !is_test(path));
        ensure!(!paths.is_empty(), "there is no Rust file in {}", source.display());
        let mut house = Self { files: Vec::new(), aliases: BTreeMap::new(), modules: BTreeSet::from([Vec::new()]) };
        for path in paths {
            let module = module_of(path.strip_prefix(source)?);
            let text = read_to_string(&path).with_context(|| path.display().to_string())?;
            house.add(path, module, &text)?;
        }
        Ok(house)
    }

    fn add(&mut self, path: PathBuf, module: Module, text: &str) -> Result<()> {
        let file = syn::parse_file(text).with_context(|| path.display().to_string())?;
        let mut named = Named::default();
        named.visit_file(&file);
        for (name, path) in named.aliases {
            self.aliases.insert((module.clone(), name), path);
        }
        self.modules.insert(module.clone());
        self.files.push((path, module, named.paths));
        Ok(())
    }

    /// The arrows between the rooms of each folder, by the folder's path below `src`: `/read/las`.
    fn folders(&self) -> BTreeMap<String, Arrows> {
        let mut folders: BTreeMap<String, Arrows> = BTreeMap::new();
        for (file, module, paths) in &self.files {
            for to in paths.iter().filter_map(|path| self.resolve(module, path, 0)) {
                let shared = module.iter().zip(&to).take_while(|(from, to)| from == to).count();
                // What holds rooms, a folder's `mod.rs` or the crate's root, is none of them.
                let (Some(from), Some(to)) = (module.get(shared), to.get(shared)) else { continue };
                let folder = module[..shared].iter().map(|room| format!("/{room}")).collect();
                let arrows = folders.entry(folder).or_default();
                arrows.entry((from.clone(), to.clone())).or_insert_with(|| file.clone());
            }
        }
        folders
    }

    /// The module in which the thing at `path`, as written in `module`, is defined; `None` for other crates' things.
    fn resolve(&self, module: &Module, path: &[String], depth: usize) -> Option<Module> {
        // A name that is handed on in a circle is no name.
        if depth > 16 {
            return None;
        }
        let mut at = module.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => at.clear(),
            "self" => {}
            "super" => {
                at.pop()?;
            }
            first => {
                let child = [&at[..], &[first.to_owned()]].concat();
                if self.modules.contains(&child) {
                    at = child;
                } else {
                    let target = self.aliases.get(&(at.clone(), first.to_owned()))?;
                    // `use name::…` of another crate is an alias of itself.
                    if target.first().is_some_and(|start| start == first) {
                        return None;
                    }
                    let target = [&target[..], &path[1..]].concat();
                    return self.resolve(module, &target, depth + 1);
                }
            }
        }
        rest = &rest[1..];
        while let Some(name) = rest.first() {
            if name == "super" {
                at.pop()?;
            } else {
                let child = [&at[..], std::slice::from_ref(name)].concat();
                if self.modules.contains(&child) {
                    at = child;
                } else {
                    return match self.aliases.get(&(at.clone(), name.clone())) {
                        Some(target) => self.resolve(&at, &[&target[..], &rest[1..]].concat(), depth + 1).or(Some(at)),
                        None => Some(at),
                    };
                }
            }
            rest = &rest[1..];
        }
        Some(at)
    }
}

/// The module that a file, relative to `src`, is.
fn module_of(file: &Path) -> Module {
    let mut module: Module =
        file.with_extension("").components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    if module.last().is_some_and(|name| ["mod", "lib", "main"].contains(&name.as_str())) {
        module.pop();
    }
    module
}

/// Every path of two names and more that a file writes down, and what its `use` lines call by which name.
#[derive(Default)]
struct Named {
    /// Modules written out in the file that the visit is inside of; `super` leads out of them first.
    depth: usize,
    paths: Vec<Vec<String>>,
    aliases: Vec<(String, Vec<String>)>,
}

impl Named {
    fn tree(&mut self, before: &[String], tree: &syn::UseTree) {
        match tree {
            syn::UseTree::Path(path) => self.tree(&[before, &[path.ident.to_string()]].concat(), &path.tree),
            syn::UseTree::Name(name) if name.ident == "self" => self.alias(before.last().cloned(), before.to_vec()),
            syn::UseTree::Name(name) => {
                let name = name.ident.to_string();
                self.alias(Some(name.clone()), [before, &[name]].concat());
            }
            syn::UseTree::Rename(name) => {
                self.alias(Some(name.rename.to_string()), [before, &[name.ident.to_string()]].concat());
            }
            syn::UseTree::Glob(_) => self.push(before.to_vec()),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.tree(before, tree)),
        }
    }

    /// What a macro or an attribute is given is text to the parser.
    fn text(&mut self, text: &str) {
        let text = text.replace(" :: ", "::");
        let in_path = |character: char| character.is_alphanumeric() || "_:".contains(character);
        for path in text.split(|character| !in_path(character)) {
            let names: Vec<String> = path.split("::").map(str::to_owned).collect();
            if names.len() > 1 && names.iter().all(|name| !name.is_empty() && !name.contains(':')) {
                self.push(names);
            }
        }
    }

    fn push(&mut self, path: Vec<String>) {
        let leading = path.iter().take_while(|name| *name == "super").count().min(self.depth);
        let path = if leading > 0 { [&["self".to_owned()], &path[leading..]].concat() } else { path };
        self.paths.push(path);
    }

    fn alias(&mut self, name: Option<String>, path: Vec<String>) {
        // A name inside a written-out module is none of the file's.
        if self.depth == 0 {
            self.aliases.extend(name.map(|name| (name, path.clone())));
        }
        self.push(path);
    }
}

impl<'ast> Visit<'ast> for Named {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        let is_test = |attribute: &syn::Attribute| {
            attribute.path().is_ident("cfg")
                && attribute.meta.require_list().is_ok_and(|list| list.tokens.to_string() == "test")
        };
        if item.attrs.iter().any(is_test) {
            return;
        }
        self.depth += 1;
        visit::visit_item_mod(self, item);
        self.depth -= 1;
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.tree(&[], &item.tree);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.text(&item.tokens.to_string());
        visit::visit_macro(self, item);
    }

    fn visit_meta_list(&mut self, list: &'ast syn::MetaList) {
        self.text(&list.tokens.to_string());
        visit::visit_meta_list(self, list);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if names.len() > 1 && path.leading_colon.is_none() {
            self.push(names);
        }
        visit::visit_path(self, path);
    }
}

/// The Rust files below a folder, in order.
pub(crate) fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrows(files: &[(&str, &str)]) -> Vec<String> {
        let mut house = House { files: Vec::new(), aliases: BTreeMap::new(), modules: BTreeSet::from([Vec::new()]) };
        for (file, text) in files {
            house.add(PathBuf::from(file), module_of(Path::new(file)), text).expect("Rust");
        }
        let shown = |(folder, arrows): (String, Arrows)| {
            arrows
                .into_keys()
                .map(move |(from, to)| format!("{folder}{}{from} {to}", if folder.is_empty() { "" } else { ": " }))
        };
        house.folders().into_iter().flat_map(shown).collect()
    }

    #[test]
    fn every_form_of_import_is_an_arrow() {
        let rooms =
            [("project/mod.rs", ""), ("search.rs", ""), ("splat/cpu.rs", "pub fn f() {}"), ("splat/mod.rs", "")];
        let found = |text: &str| arrows(&[&rooms[..], &[("fit/mod.rs", "pub mod a;"), ("fit/a.rs", text)]].concat());
        assert_eq!(found("use crate::splat::{GBuffer, cpu::{A, B}};"), ["fit splat"], "a group");
        assert_eq!(found("use super::super::search::A;"), ["fit search"], "by the parent of the parent");
        assert_eq!(found("fn f() { crate::splat::cpu::f() }"), ["fit splat"], "a call");
        assert_eq!(found("fn f(a: &crate::project::A) {}"), ["fit project"], "a type");
        assert_eq!(found("use crate::{splat as other}; fn f() { other::g() }"), ["fit splat"], "another name");
        assert_eq!(found("use crate::search::*;"), ["fit search"], "a glob");
        assert_eq!(found("fn f() { assert!(g(crate::splat::cpu::f()), \"{}\", 1) }"), ["fit splat"], "in a macro");
        assert_eq!(found("#[error(\"{}\", crate::search::A)] struct B;"), ["fit search"], "in an attribute");
        assert_eq!(found("mod inner { use super::super::search::A; }"), [""; 0], "super leads out of the inner module");
        assert_eq!(found("mod inner { use super::super::super::search::A; }"), ["fit search"], "and once more");
        assert_eq!(found("#[cfg(test)] mod tests { use crate::splat::A; }"), [""; 0], "tests may use what is later");
        assert_eq!(found("// use crate::splat::A;\nuse std::search::B; use super::C;"), [""; 0], "none of these");
    }

    #[test]
    fn rooms_of_folders_are_rooms() {
        let files = [
            ("read/mod.rs", "mod job; mod ply; use self::job::Job;"),
            ("read/job.rs", ""),
            ("read/ply/mod.rs", "mod header; use super::Job; use self::header::Header;"),
            ("read/ply/header.rs", "use super::super::job::Job; use crate::write::f;"),
            ("write.rs", ""),
        ];
        assert_eq!(arrows(&files), ["read write", "/read: ply job"], "neither `mod.rs` nor what it holds");
    }

    #[test]
    fn names_handed_on_count_as_where_they_are_from() {
        let files = [
            ("lib.rs", "pub use renderer::MAX_SIDE; pub use fit::{Surfels as Discs, inner};"),
            ("renderer/mod.rs", "mod settings; pub use settings::MAX_SIDE;"),
            ("renderer/settings.rs", "pub const MAX_SIDE: u32 = 1;"),
            ("fit/mod.rs", "pub mod inner;"),
            ("fit/inner.rs", ""),
            ("error.rs", "use crate::MAX_SIDE;"),
            ("shade.rs", "use crate::Discs;"),
            ("splat.rs", "fn f() { crate::inner::g() }"),
        ];
        assert_eq!(arrows(&files), ["error renderer", "shade fit", "splat fit"], "through the root");
    }

    #[test]
    fn circles_are_found_whole() {
        let arrow = |from: &str, to: &str| ((from.to_owned(), to.to_owned()), PathBuf::new());
        let arrows =
            Arrows::from([arrow("a", "b"), arrow("b", "c"), arrow("c", "a"), arrow("c", "d"), arrow("d", "e")]);
        assert_eq!(circles(&arrows), [["a", "b", "c"]], "and d and e are in none");
    }

    #[test]
    fn later_stages_are_forbidden() {
        let arrow = |from: &str, to: &str| ((from.to_owned(), to.to_owned()), PathBuf::from(from));
        let wrong = |from, to| !against_the_frame(&Arrows::from([arrow(from, to)])).is_empty();
        assert!(wrong("fit", "splat"), "fit comes before splat");
        assert!(wrong("normals", "splat"), "normals need no picture");
        assert!(wrong("camera", "project"), "what is no stage uses none");
        assert!(!wrong("shade", "splat"), "shade comes after splat");
        assert!(!wrong("shade", "camera"), "what is no stage comes before all");
    }
}
