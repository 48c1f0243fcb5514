//! XML that is not quite well formed, made well formed where its meaning is clear.
//!
//! Programs write names with bare `&` and control characters, declare a namespace twice or never, and put other bytes
//! before and behind. The parser refuses all of it. Here the text is written anew, tag by tag, without these faults.

use std::fmt::Write as _;

/// Most prefixes that are declared for a file that uses them without.
const MAX_PREFIXES: usize = 64;

/// How many open elements a closing tag may close; more is no slip of a program.
const MAX_CLOSED: usize = 16;

/// The text without faults that have one clear remedy. Comments and instructions are left out, and the text ends with
/// the root. Elements still open at the end are closed, but a prototype that is cut off is left out.
pub(super) fn repaired(text: &str) -> String {
    let mut writer = Writer { out: String::with_capacity(text.len()), ..Writer::default() };
    let mut rest = text;
    while let Some(start) = rest.find('<').filter(|_| !writer.done) {
        writer.text(&rest[..start]);
        rest = &rest[start..];
        let tag = rest[1..].chars().next().unwrap_or_default();
        let (open, close) = match tag {
            _ if rest.starts_with("<!--") => ("<!--", "-->"),
            _ if rest.starts_with("<![CDATA[") => ("<![CDATA[", "]]>"),
            '?' => ("<?", "?>"),
            '!' | '/' => ("<", ">"),
            _ if tag.is_alphabetic() || tag == '_' => ("<", ""),
            _ => {
                writer.text("&lt;");
                rest = &rest[1..];
                continue;
            }
        };
        let end =
            if close.is_empty() { tag_end(rest) } else { rest[open.len()..].find(close).map(|at| at + open.len()) };
        let Some(end) = end else { break };
        let inner = &rest[open.len()..end];
        match tag {
            '/' => writer.close(inner[1..].trim()),
            '!' if open == "<![CDATA[" => writer.text(&inner.replace('&', "&amp;").replace('<', "&lt;")),
            '!' if open == "<!--" => {}
            // Declarations are left to the parser, which refuses them.
            '!' => writer.out += &rest[..=end],
            '?' => {}
            _ => writer.open(inner),
        }
        rest = &rest[end + close.len().max(1)..];
    }
    writer.finish()
}

/// The first `>` of a start tag outside of quotes.
fn tag_end(tag: &str) -> Option<usize> {
    let mut quote = None;
    tag.char_indices().find_map(|(at, c)| {
        match (quote, c) {
            (None, '>') => return Some(at),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
        None
    })
}

#[derive(Default)]
struct Writer<'a> {
    out: String,
    /// Names of the open elements, and where their tags begin in `out`.
    open: Vec<(&'a str, usize)>,
    /// End of the root's name in `out`, and the prefixes that the root declares.
    root: Option<(usize, Vec<&'a str>)>,
    /// Prefixes of elements and attributes.
    used: Vec<&'a str>,
    /// Whether the root is closed.
    done: bool,
}

impl<'a> Writer<'a> {
    /// Writes text inside of the root, without control characters and with every `&` part of an entity.
    fn text(&mut self, text: &str) {
        if self.open.is_empty() {
            return;
        }
        let mut rest = text;
        while let Some(at) = rest.find('&') {
            self.plain(&rest[..at]);
            rest = &rest[at..];
            let len = entity(rest);
            self.out += len.map_or("&amp;", |len| &rest[..len]);
            rest = &rest[len.unwrap_or(1)..];
        }
        self.plain(rest);
    }

    fn plain(&mut self, text: &str) {
        self.out.extend(text.chars().filter(|&c| is_allowed(c)));
    }

    /// Writes a start tag: each attribute once, with its value in quotes.
    fn open(&mut self, tag: &'a str) {
        let empty = tag.ends_with('/');
        let tag = tag.strip_suffix('/').unwrap_or(tag);
        let (name, mut rest) = tag.split_at(tag.find(char::is_whitespace).unwrap_or(tag.len()));
        let start = self.out.len();
        self.out.push('<');
        self.out += name;
        let end = self.out.len();
        self.open.push((name, start));
        self.uses(name);
        let mut names: Vec<&str> = Vec::new();
        while let Some((attribute, after)) = rest.split_once('=') {
            let after = after.trim_start();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c));
            let (value, later) = match quote {
                Some(quote) => after[1..].split_once(quote).unwrap_or((&after[1..], "")),
                None => after.split_at(after.find(char::is_whitespace).unwrap_or(after.len())),
            };
            rest = later;
            // Words without a value are no attributes.
            let attribute = attribute.split_whitespace().next_back().unwrap_or_default();
            let useless = attribute.is_empty() || attribute.starts_with("xmlns:") && value.is_empty();
            if useless || names.contains(&attribute) {
                continue;
            }
            names.push(attribute);
            self.uses(attribute);
            let _ = write!(self.out, " {attribute}=\"");
            self.text(&value.replace('<', "&lt;").replace('"', "&quot;"));
            self.out.push('"');
        }
        if self.root.is_none() {
            self.root = Some((end, names.iter().filter_map(|name| name.strip_prefix("xmlns:")).collect()));
        }
        self.out += if empty { "/>" } else { ">" };
        if empty {
            self.open.pop();
            self.done = self.open.is_empty();
        }
    }

    fn uses(&mut self, name: &'a str) {
        let prefix = name.split_once(':').map(|(prefix, _)| prefix);
        let Some(prefix) = prefix.filter(|prefix| !["xmlns", "xml"].contains(prefix)) else { return };
        if self.used.len() < MAX_PREFIXES && !self.used.contains(&prefix) {
            self.used.push(prefix);
        }
    }

    /// Closes an element and those open inside of it. A tag that closes nothing is left out.
    fn close(&mut self, name: &str) {
        let Some(inside) = self.open.iter().rev().take(MAX_CLOSED).position(|(open, _)| *open == name) else { return };
        (0..=inside).for_each(|_| self.close_last());
        self.done = self.open.is_empty();
    }

    fn close_last(&mut self) {
        if let Some((name, _)) = self.open.pop() {
            let _ = write!(self.out, "</{name}>");
        }
    }

    fn finish(mut self) -> String {
        if let Some(place) = self.open.iter().position(|(name, _)| *name == "prototype") {
            self.out.truncate(self.open[place].1);
            self.open.truncate(place);
        }
        while !self.open.is_empty() {
            self.close_last();
        }
        if let Some((end, declared)) = self.root {
            let missing = self.used.iter().filter(|prefix| !declared.contains(prefix));
            let missing = missing.map(|prefix| format!(" xmlns:{prefix}=\"undeclared:{prefix}\"")).collect::<String>();
            self.out.insert_str(end, &missing);
        }
        self.out
    }
}

/// Length of the entity at the start of the text, if the text starts with an entity of XML.
fn entity(text: &str) -> Option<usize> {
    let end = text.bytes().take(12).position(|byte| byte == b';')?;
    let name = &text[1..end];
    let known = match name.strip_prefix('#') {
        None => ["amp", "lt", "gt", "quot", "apos"].contains(&name),
        Some(code) => {
            let code = match code.strip_prefix('x') {
                Some(code) => u32::from_str_radix(code, 16),
                None => code.parse(),
            };
            code.ok().and_then(char::from_u32).is_some_and(is_allowed)
        }
    };
    known.then_some(end + 1)
}

/// Whether XML may contain the character.
fn is_allowed(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
}

#[cfg(test)]
mod tests {
    use super::repaired;

    #[test]
    fn what_is_clear_is_repaired() {
        let cases = [
            ("<?xml version='1.0'?><a b='1'>t</a>", "<a b=\"1\">t</a>"),
            ("\u{feff}junk <a>x</a> junk <b>", "<a>x</a>"),
            ("<a x=1 x='2' y=\"'\" z>&</a>", "<a x=\"1\" y=\"'\">&amp;</a>"),
            ("<a xmlns:p='u' xmlns:p='u'><p:b/></a>", "<a xmlns:p=\"u\"><p:b/></a>"),
            ("<a><p:b q:c='1'/></a>", "<a xmlns:p=\"undeclared:p\" xmlns:q=\"undeclared:q\"><p:b q:c=\"1\"/></a>"),
            ("<a>&amp; &nbsp; &#65; &#0; &#x1; 1 < 2</a>", "<a>&amp; &amp;nbsp; &#65; &amp;#0; &amp;#x1; 1 &lt; 2</a>"),
            ("<a>\u{1}b\u{0}<!-- -- --><![CDATA[<&]]></a>", "<a>b&lt;&amp;</a>"),
            ("<a><b><c></a>", "<a><b><c></c></b></a>"),
            ("<a></b><c x='>'/></a>", "<a><c x=\">\"/></a>"),
            ("<a><points><prototype><x/><y", "<a><points></points></a>"),
            ("<a><points><prototype/></poi", "<a><points><prototype/></points></a>"),
            ("<", ""),
            ("", ""),
            ("<!DOCTYPE a [<!ENTITY b \"bb\">]><a>&b;</a>", "<!DOCTYPE a [<!ENTITY b \"bb\"><a>&amp;b;</a>"),
        ];
        for (text, expected) in cases {
            assert_eq!(repaired(text), expected, "{text:?}");
        }
    }
}
