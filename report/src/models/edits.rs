//! Edits of single places in a text, which is otherwise preserved.

use std::ops::Range;

use roxmltree::{Document, Node};

/// Changes of an XML text.
pub struct Edits<'a> {
    text: &'a str,
    all: Vec<(Range<usize>, String)>,
    /// Attributes to add to a start tag, by the offset behind the tag's name.
    added: Vec<(usize, String)>,
}

impl<'a> Edits<'a> {
    pub fn of(text: &'a str) -> Self {
        Self {
            text,
            all: Vec::new(),
            added: Vec::new(),
        }
    }

    /// Sets an attribute, which may be absent.
    pub fn set(&mut self, node: Node<'_, '_>, name: &str, value: &str) {
        match node.attribute_node(name) {
            Some(old) => self.all.push((old.range_value(), value.to_owned())),
            None => self
                .added
                .push((behind_name(self.text, node), format!(" {name}=\"{value}\""))),
        }
    }

    /// Removes an attribute.
    pub fn remove(&mut self, node: Node<'_, '_>, name: &str) {
        if let Some(old) = node.attribute_node(name) {
            let range = old.range();
            let blanks = self.text[..range.start].len() - self.text[..range.start].trim_end().len();
            self.all
                .push((range.start - blanks..range.end, String::new()));
        }
    }

    /// Replaces the content of an element, or the element.
    pub fn replace(&mut self, range: Range<usize>, new: String) {
        self.all.push((range, new));
    }

    /// Inserts an element as the first child of another.
    pub fn insert(&mut self, node: Node<'_, '_>, element: &str) {
        let outer = indent_of(self.text, node.range().start);
        if let Some(first) = node.first_child() {
            let at = first.range().start;
            self.all.push((at..at, format!("\n{outer}  {element}")));
            return;
        }
        let whole = &self.text[node.range()];
        let end = node.range().end;
        let name = tag_name(self.text, node);
        let closed = format!(">\n{outer}  {element}\n{outer}</{name}>");
        let head = whole.strip_suffix("/>").map(|head| head.trim_end().len());
        let open = whole
            .rfind("</")
            .map(|at| whole[..at].trim_end_matches('>').len());
        let from = node.range().start + head.or(open).unwrap_or(whole.len());
        self.all.push((from..end, closed));
    }

    /// The text with all changes.
    pub fn done(self) -> String {
        let mut text = self.text.to_owned();
        let mut all = self.all;
        all.extend(self.added.into_iter().map(|(at, new)| (at..at, new)));
        // A stable sort keeps the order of additions at one place, and puts them before replacements there.
        all.sort_by_key(|(range, _)| (range.start, range.end));
        for (range, new) in all.into_iter().rev() {
            text.replace_range(range, &new);
        }
        text
    }
}

/// The name of an element as written, with its prefix.
fn tag_name<'a>(text: &'a str, node: Node<'_, '_>) -> &'a str {
    let from = node.range().start + 1;
    let rest = &text[from..];
    let end = rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/');
    &rest[..end.unwrap_or(rest.len())]
}

fn behind_name(text: &str, node: Node<'_, '_>) -> usize {
    node.range().start + 1 + tag_name(text, node).len()
}

/// The indentation of the line of an element.
pub fn indent_of(text: &str, at: usize) -> String {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let before = &text[line..at];
    let blanks = before.len() - before.trim_start().len();
    before[..blanks].to_owned()
}

/// The element of that kind and name below a node.
pub fn named<'a, 'i>(document: &'a Document<'i>, tag: &str, name: &str) -> Option<Node<'a, 'i>> {
    let mut all = document.root_element().children();
    all.find(|node| node.has_tag_name(tag) && node.attribute("name") == Some(name))
}

/// The child element of that kind.
pub fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(tag))
}

/// A number with as many digits as necessary, at most twelve.
pub fn digits(x: f64) -> String {
    let text = format!("{x:.11e}");
    text.parse::<f64>().map_or(text, |x| x.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_changed_at_their_places() {
        let text = "<a><!-- kept --><b  x='1'\n y=\"2\" /><c></c></a>";
        let document = Document::parse(text).unwrap();
        let root = document.root_element();
        let (b, c) = (child(root, "b").unwrap(), child(root, "c").unwrap());
        let mut edits = Edits::of(text);
        edits.set(b, "y", "3");
        edits.remove(b, "x");
        edits.set(b, "z", "4");
        edits.insert(c, "<d/>");
        let done = edits.done();
        assert_eq!(
            done,
            "<a><!-- kept --><b z=\"4\"\n y=\"3\" /><c>\n   <d/>\n </c></a>"
        );
        assert!(Document::parse(&done).is_ok());
    }
}
