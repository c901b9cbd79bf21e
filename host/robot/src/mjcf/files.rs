//! The files of a model: the one that is read, and those that it includes, whose elements stand in place of `<include>`.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::fault::{MjcfFault, Wrong};
use crate::source::{Fault, FileError, Source};
use crate::xml::{Attribute, Document, Element};

/// More files than this include each other in a circle.
const MAX_FILES: usize = 1000;

/// All files of a model, the main one first.
pub(super) struct Files {
    files: Vec<(Source, Document)>,
    /// By the file and the place of an `<include>`, the file that it names.
    included: HashMap<(usize, usize), usize>,
}

/// An element of a model.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    files: &'a Files,
    file: usize,
    element: Element<'a>,
}

impl Files {
    /// Reads what `source` includes, and what that includes; paths are relative to the folder of the main file.
    pub(super) fn read(source: Source) -> Result<Self, FileError<MjcfFault>> {
        let not_xml =
            |source: &Source, wrong: crate::xml::NotXml| source.error(Some(wrong.span), Fault::Syntax(wrong.reason));
        let document = Document::parse(&source).map_err(|wrong| not_xml(&source, wrong))?;
        let mut all = Self { files: vec![(source, document)], included: HashMap::new() };
        let mut n_bytes = all.files[0].0.text().len() as u64;
        let mut file = 0;
        while file < all.files.len() {
            for (span, name) in includes(all.files[file].1.root()) {
                let (source, path) = (&all.files[file].0, all.path(&name));
                let failed = |reason: String| {
                    let path = path.display().to_string();
                    source.wrong(span.clone(), MjcfFault::File { path, reason })
                };
                if all.files.len() >= MAX_FILES {
                    return Err(failed("more than 1000 files include each other; remove an <include>".into()));
                }
                let named = source.files().file(&path);
                let next = Source::read::<MjcfFault>(named).map_err(|error| failed(error.fault.to_string()))?;
                // A file may be included many times, and each time takes memory.
                n_bytes += next.text().len() as u64;
                if n_bytes > source.files().limits().model_bytes {
                    let max = source.files().limits().model_bytes >> 20;
                    return Err(failed(format!(
                        "the model has more than {max} MiB with what it includes; include less"
                    )));
                }
                let document = Document::parse(&next).map_err(|wrong| not_xml(&next, wrong))?;
                all.included.insert((file, span.start), all.files.len());
                all.files.push((next, document));
            }
            file += 1;
        }
        Ok(all)
    }

    pub(super) fn root(&self) -> Part<'_> {
        Part { files: self, file: 0, element: self.files[0].1.root() }
    }

    /// A path that the model names.
    pub(super) fn path(&self, named: &str) -> PathBuf {
        self.files[0].0.companion(named)
    }

    /// The bytes of a file that the model names.
    pub(super) fn bytes(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.files[0].0.files().read(path)
    }

    /// The error with the place of what is wrong.
    pub(super) fn error(&self, wrong: Wrong) -> FileError<MjcfFault> {
        self.files[wrong.file].0.wrong(wrong.span, wrong.fault)
    }
}

/// The places of all `<include>` and the files that they name.
fn includes(root: Element<'_>) -> Vec<(Range<usize>, String)> {
    let (mut found, mut ahead) = (Vec::new(), vec![root]);
    while let Some(element) = ahead.pop() {
        if element.tag() == "include" {
            found.extend(element.value("file").map(|file| (element.span(), file.to_owned())));
        }
        ahead.extend(element.children());
    }
    found.sort_by_key(|(span, _)| span.start);
    found
}

impl<'a> Part<'a> {
    pub(super) fn tag(self) -> &'a str {
        self.element.tag()
    }

    /// Its children; in place of an `<include>` those of the root of the file.
    pub(super) fn children(self) -> Vec<Self> {
        let (mut found, mut ahead) = (Vec::new(), vec![self.element.children().map(|e| (self.file, e)).collect()]);
        while let Some(level) = ahead.last_mut() {
            let level: &mut std::collections::VecDeque<_> = level;
            let Some((file, element)) = level.pop_front() else {
                ahead.pop();
                continue;
            };
            match self.files.included.get(&(file, element.span().start)) {
                Some(&next) => {
                    ahead.push(self.files.files[next].1.root().children().map(|e| (next, e)).collect());
                }
                None => found.push(Part { file, element, ..self }),
            }
        }
        found
    }

    /// Its children of this name.
    pub(super) fn named(self, tag: &str) -> impl Iterator<Item = Self> {
        self.children().into_iter().filter(move |child| child.tag() == tag)
    }

    pub(super) fn attributes(self) -> &'a [Attribute] {
        self.element.attributes()
    }

    pub(super) fn attribute(self, name: &str) -> Option<&'a Attribute> {
        self.element.attribute(name)
    }

    pub(super) fn value(self, name: &str) -> Option<&'a str> {
        self.element.value(name)
    }

    /// A fault at the element.
    pub(super) fn wrong(self, fault: MjcfFault) -> Wrong {
        Wrong { file: self.file, span: self.element.span(), fault }
    }

    /// The fault that this attribute is not what it should be.
    pub(super) fn wrong_value(self, attribute: &Attribute, expected: &'static str) -> Wrong {
        let fault = MjcfFault::Value { attribute: attribute.name.clone(), value: attribute.value.clone(), expected };
        Wrong { file: self.file, span: attribute.span.clone(), fault }
    }

    /// The element is refused.
    pub(super) fn unsupported(self, what: impl Into<String>, cure: impl Into<Cow<'static, str>>) -> Wrong {
        self.wrong(MjcfFault::Unsupported { what: what.into(), cure: cure.into() })
    }

    /// `FILE:LINE:COLUMN` of an attribute.
    pub(super) fn place_of(self, attribute: &Attribute) -> String {
        self.files.files[self.file].0.location(attribute.name_span.clone())
    }

    /// `FILE:LINE:COLUMN` of the element.
    pub(super) fn place(self) -> String {
        self.files.files[self.file].0.location(self.element.span())
    }
}
