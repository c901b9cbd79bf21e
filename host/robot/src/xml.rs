//! Elements of an XML file with their places, for formats that read some of the elements and skip the others.
//!
//! A prefix of a name is kept as it is written, and elements nest as deep as memory holds.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};

use crate::source::Source;

/// A file that is not XML: the place where that is found, and why.
#[derive(Debug)]
pub(crate) struct NotXml {
    pub(crate) span: Range<usize>,
    pub(crate) reason: String,
}

/// All elements of one file, the root first.
#[derive(Debug)]
pub(crate) struct Document {
    nodes: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    tag: String,
    attributes: Vec<Attribute>,
    children: Vec<usize>,
    span: Range<usize>,
}

/// A name and its value.
#[derive(Debug)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) value: String,
    /// Where the name is.
    pub(crate) name_span: Range<usize>,
    /// Where the value is.
    pub(crate) span: Range<usize>,
}

/// An element of a document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element<'a> {
    document: &'a Document,
    node: &'a Node,
}

impl Document {
    /// Reads the elements of a file.
    pub(crate) fn parse(source: &Source) -> Result<Self, NotXml> {
        let text = source.text();
        let mut reader = Reader::from_str(text);
        let mut document = Self { nodes: Vec::new() };
        let mut open: Vec<usize> = Vec::new();
        loop {
            let start = offset(reader.buffer_position(), text);
            let event = reader.read_event().map_err(|error| {
                let at = offset(reader.error_position(), text);
                NotXml { span: at..text.len(), reason: format!("{error}; correct the XML") }
            })?;
            let span = start..offset(reader.buffer_position(), text);
            match event {
                Event::Start(tag) => open.push(document.add(&tag, text, span, open.last())?),
                Event::Empty(tag) => drop(document.add(&tag, text, span, open.last())?),
                Event::End(_) => drop(open.pop()),
                Event::Eof => break,
                _ => {}
            }
        }
        match open.last() {
            Some(&node) => {
                let span = document.nodes[node].span.clone();
                Err(NotXml { span, reason: "the element is not closed; add its end tag".into() })
            }
            None if document.nodes.is_empty() => {
                Err(NotXml { span: 0..0, reason: "the file has no element; give a URDF or MJCF".into() })
            }
            None => Ok(document),
        }
    }

    fn add(
        &mut self,
        tag: &BytesStart<'_>,
        text: &str,
        span: Range<usize>,
        parent: Option<&usize>,
    ) -> Result<usize, NotXml> {
        let node = self.nodes.len();
        match parent {
            Some(&parent) => self.nodes[parent].children.push(node),
            None if node == 0 => {}
            None => {
                return Err(NotXml { span, reason: "a second root element; put all into one".into() });
            }
        }
        let tag_name = String::from_utf8_lossy(tag.name().as_ref()).into_owned();
        let attributes = attributes(tag, text).map_err(|error| NotXml {
            span: span.clone(),
            reason: format!("<{tag_name}>: {error}; correct the XML"),
        })?;
        self.nodes.push(Node { tag: tag_name, attributes, children: Vec::new(), span });
        Ok(node)
    }

    /// All elements, in the order of the file.
    pub(crate) fn elements(&self) -> impl Iterator<Item = Element<'_>> {
        self.nodes.iter().map(|node| Element { document: self, node })
    }

    /// The outermost element.
    pub(crate) fn root(&self) -> Element<'_> {
        Element { document: self, node: &self.nodes[0] }
    }
}

impl<'a> Element<'a> {
    pub(crate) fn tag(self) -> &'a str {
        &self.node.tag
    }

    /// The start tag in the text.
    pub(crate) fn span(self) -> Range<usize> {
        self.node.span.clone()
    }

    pub(crate) fn children(self) -> impl DoubleEndedIterator<Item = Self> {
        self.node.children.iter().map(move |&node| Self { node: &self.document.nodes[node], ..self })
    }

    /// The first child of this name.
    pub(crate) fn child(self, tag: &str) -> Option<Self> {
        self.children().find(|child| child.tag() == tag)
    }

    pub(crate) fn attributes(self) -> &'a [Attribute] {
        &self.node.attributes
    }

    pub(crate) fn attribute(self, name: &str) -> Option<&'a Attribute> {
        self.node.attributes.iter().find(|attribute| attribute.name == name)
    }

    /// The value of an attribute.
    pub(crate) fn value(self, name: &str) -> Option<&'a str> {
        self.attribute(name).map(|attribute| attribute.value.as_str())
    }
}

impl Attribute {
    /// The numbers of the value, between blanks; `None` when one is not a finite number.
    pub(crate) fn numbers(&self) -> Option<Vec<f64>> {
        let number = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
        self.value.split_whitespace().map(number).collect()
    }
}

fn attributes(tag: &BytesStart<'_>, text: &str) -> Result<Vec<Attribute>, AttrError> {
    let mut found: Vec<Attribute> = Vec::new();
    for attribute in tag.attributes() {
        let attribute = attribute?;
        let span_of = |part: &[u8]| {
            let start = (part.as_ptr() as usize).wrapping_sub(text.as_ptr() as usize);
            let end = start.wrapping_add(part.len());
            if start <= end && end <= text.len() { start..end } else { 0..0 }
        };
        let (span, name_span) = (span_of(&attribute.value), span_of(attribute.key.as_ref()));
        let raw = String::from_utf8_lossy(&attribute.value);
        let value = quick_xml::escape::unescape(&raw).map_or_else(|_| raw.to_string(), |value| value.into_owned());
        found.push(Attribute {
            name: String::from_utf8_lossy(attribute.key.as_ref()).into_owned(),
            value,
            name_span,
            span,
        });
    }
    Ok(found)
}

fn offset(position: u64, text: &str) -> usize {
    usize::try_from(position).map_or(text.len(), |position| position.min(text.len()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(text: &str) -> Result<Document, NotXml> {
        Document::parse(&Source::of_text(Path::new("x.xml"), text))
    }

    #[test]
    fn elements_have_places_and_attributes_their_values() {
        let text = "<?xml version=\"1.0\"?>\n<a x='1 -2e1' x:y=\"&lt;\">\n <b/><c:d/></a>";
        let document = parse(text).unwrap();
        let root = document.root();
        assert_eq!((root.tag(), root.span().start, root.value("x:y")), ("a", 22, Some("<")));
        let x = root.attribute("x").unwrap();
        assert_eq!((x.numbers(), &text[x.span.clone()]), (Some(vec![1.0, -20.0]), "1 -2e1"));
        assert_eq!(root.children().map(Element::tag).collect::<Vec<_>>(), ["b", "c:d"]);
    }

    #[test]
    fn what_is_no_xml_has_a_place() {
        let attributes = ["<a><b c=1/></a>", "<a><b c/></a>", "<a><b c='1' c='2'/></a>"].map(|text| (text, 3));
        for (text, at) in [("<a>\n<b></a>", 7), ("<a/><b/>", 4), ("", 0), ("<a><b>", 3)].into_iter().chain(attributes) {
            assert_eq!(parse(text).unwrap_err().span.start, at, "{text}");
        }
    }

    #[test]
    fn a_deep_nest_is_read() {
        let text = "<a>".repeat(100_000) + &"</a>".repeat(100_000);
        assert_eq!(parse(&text).unwrap().nodes.len(), 100_000);
    }
}
