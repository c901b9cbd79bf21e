//! No circles: imports among files, and calls between a module and those inside it, run in one direction.

use std::collections::{BTreeMap, BTreeSet};

use darm_rules::{Source, assert_none, sources};
use syn::visit::{self, Visit};

fn parsed(source: &Source) -> syn::File {
    syn::parse_file(&source.text).unwrap_or_else(|error| panic!("{}: {error}", source.path))
}

fn is_of_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let is_test = |list: &syn::MetaList| list.tokens.to_string() == "test";
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg") && attribute.meta.require_list().is_ok_and(is_test)
    })
}

/// A module by the names on its path.
type Module = Vec<String>;

/// What a source imports by `crate::` and `super::`, as paths from the root of its crate.
struct Imports<'a> {
    own: &'a [String],
    found: BTreeSet<Module>,
}

impl Imports<'_> {
    fn add(&mut self, path: &[String]) {
        let own = &self.own[..self.own.len().saturating_sub(1)];
        match path.split_first() {
            Some((first, rest)) if first == "crate" => self.found.insert(rest.to_vec()),
            Some((first, rest)) if first == "super" => self.found.insert([own, rest].concat()),
            _ => false,
        };
    }

    fn add_tree(&mut self, before: &[String], tree: &syn::UseTree) {
        match tree {
            syn::UseTree::Path(path) => self.add_tree(&[before, &[path.ident.to_string()]].concat(), &path.tree),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.add_tree(before, tree)),
            syn::UseTree::Name(name) => self.add(&[before, &[name.ident.to_string()]].concat()),
            syn::UseTree::Rename(name) => self.add(&[before, &[name.ident.to_string()]].concat()),
            syn::UseTree::Glob(_) => self.add(before),
        }
    }
}

impl<'ast> Visit<'ast> for Imports<'_> {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.add_tree(&[], &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.add(&names);
        visit::visit_path(self, path);
    }

    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        // Within an inner module `super` is this file.
        if !is_of_tests(&module.attrs) && module.content.is_none() {
            visit::visit_item_mod(self, module);
        }
    }
}

/// The module that a file is, below the folder of its crate's sources; `None` of the root and of tests.
fn module_of(source: &Source) -> Option<(&str, Module)> {
    let (package, inside) = source.path.split_once("/src/")?;
    let inside = inside.trim_end_matches(".rs").trim_end_matches("/mod");
    (!source.is_test() && !matches!(inside, "lib" | "main"))
        .then(|| (package, inside.split('/').map(Into::into).collect()))
}

/// A module and the modules inside it may import each other.
#[test]
fn files_import_in_no_circle() {
    let sources = sources();
    let mut packages: BTreeMap<&str, BTreeMap<Module, BTreeSet<Module>>> = BTreeMap::new();
    for source in &sources {
        let Some((package, own)) = module_of(source) else { continue };
        let mut imports = Imports { own: &own, found: BTreeSet::new() };
        imports.visit_file(&parsed(source));
        packages.entry(package).or_default().insert(own.clone(), imports.found);
    }
    let mut broken = Vec::new();
    for (package, mut files) in packages {
        let names: BTreeSet<Module> = files.keys().cloned().collect();
        for (own, used) in &mut files {
            let file =
                |path: &Module| (1..=path.len()).rev().map(|n| path[..n].to_vec()).find(|file| names.contains(file));
            let is_apart = |file: &Module| !file.starts_with(own) && !own.starts_with(file);
            *used = used.iter().filter_map(file).filter(is_apart).collect();
        }
        // Files that import none of those left, and files that none of those left imports, are in no circle.
        while let Some(free) = files.keys().find(|own| {
            let imports_none = !files[*own].iter().any(|used| files.contains_key(used));
            imports_none || !files.values().any(|used| used.contains(*own))
        }) {
            let free = free.clone();
            files.remove(&free);
        }
        broken.extend(files.iter().map(|(file, used)| {
            let used: Vec<String> =
                used.iter().filter(|used| files.contains_key(*used)).map(|used| used.join("/")).collect();
            format!("{package}/src/{}.rs: in a circle of imports with {}", file.join("/"), used.join(", "))
        }));
    }
    assert_none(broken);
}

/// The free functions of a source, and the modules that its code names by a path.
#[derive(Default)]
struct Calls {
    functions: BTreeSet<String>,
    named: BTreeSet<String>,
}

impl<'ast> Visit<'ast> for Calls {
    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.functions.insert(function.sig.ident.to_string());
        visit::visit_item_fn(self, function);
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        // What is only exported again is no call.
        let mut tree = &item.tree;
        while let (syn::Visibility::Inherited, syn::UseTree::Path(path)) = (&item.vis, tree) {
            self.named.insert(path.ident.to_string());
            tree = &path.tree;
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let modules = path.segments.iter().rev().skip(1);
        self.named.extend(modules.map(|segment| segment.ident.to_string()));
        visit::visit_path(self, path);
    }
}

/// A module inside another may use its types, traits and constants, but no function of a module that calls it.
#[test]
fn no_function_of_a_module_is_called_from_inside_it_and_calls_there() {
    let sources = sources();
    let files: BTreeMap<(&str, Module), &Source> =
        sources.iter().filter_map(|source| Some((module_of(source)?, source))).collect();
    let mut broken = Vec::new();
    for ((package, own), source) in &files {
        let mut imports = Imports { own, found: BTreeSet::new() };
        imports.visit_file(&parsed(source));
        for n in 1..own.len() {
            let Some(outer) = files.get(&(*package, own[..n].to_vec())) else { continue };
            let mut calls = Calls::default();
            calls.visit_file(&parsed(outer));
            let is_called = |path: &&Module| path.len() == n + 1 && path.starts_with(&own[..n]);
            let called = imports.found.iter().filter(is_called).filter(|path| calls.functions.contains(&path[n]));
            if calls.named.contains(&own[n]) {
                broken.extend(called.map(|path| format!("{}: calls `{}` of {}", source.path, path[n], outer.path)));
            }
        }
    }
    assert_none(broken);
}
