//! HTML skeleton of a page, and the blocks of its sections.

use std::borrow::Cow;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{number, style};
use hydroid::log::Note;

/// One section of a page.
#[derive(Debug)]
pub struct Section {
    /// Anchor; unique on the page.
    id: Cow<'static, str>,
    /// Heading; not shown for the first section, which has the heading of the page.
    heading: Cow<'static, str>,
    body: Markup,
}

impl Section {
    /// A section with its anchor, heading and content.
    pub fn new(
        id: impl Into<Cow<'static, str>>,
        heading: impl Into<Cow<'static, str>>,
        body: Markup,
    ) -> Self {
        Self { id: id.into(), heading: heading.into(), body }
    }
}

/// A page of sections.
pub fn page(title: &str, sections: &[Section]) -> String {
    page_with(title, sections, "", "")
}

/// A page of sections with a style and a script of its own.
pub(super) fn page_with(title: &str, sections: &[Section], own_style: &str, own_script: &str) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content="hydroid";
                title { (title) }
                style { (PreEscaped(style::SHEET)) (PreEscaped(own_style)) }
            }
            body {
                main {
                    @for (i, section) in sections.iter().enumerate() {
                        section id=(section.id) {
                            @if i > 0 { h2 { (section.heading) } }
                            (section.body)
                        }
                        @if i == 0 { (contents(&sections[1..])) }
                    }
                    footer { "Made by hydroid. This page is complete in itself and can be sent and kept as one file." }
                }
                script { (PreEscaped(style::SCRIPT)) }
                @if !own_script.is_empty() { script { (PreEscaped(own_script)) } }
            }
        }
    }
    .into_string()
}

fn contents(sections: &[Section]) -> Markup {
    html! {
        nav aria-label="Contents" {
            @for section in sections {
                a href={ "#" (section.id) } { (section.heading) }
            }
        }
    }
}

/// A figure with its caption.
pub fn figure(svg: &str, caption: &Markup) -> Markup {
    html! {
        figure {
            (PreEscaped(svg))
            figcaption { (caption) }
        }
    }
}

/// Blocks side by side if the page is wide enough.
pub fn columns(blocks: &[Markup]) -> Markup {
    html! { div.columns { @for block in blocks { div { (block) } } } }
}

/// A scrollable table. Columns from `numbers` on contain numbers.
pub fn table(heads: &[Markup], rows: &[Vec<Markup>], numbers: usize) -> Markup {
    table_of(heads, rows, |i| i >= numbers)
}

/// A table with a predicate for columns of numbers.
pub fn table_of(heads: &[Markup], rows: &[Vec<Markup>], numbers: impl Fn(usize) -> bool) -> Markup {
    let class = |i: usize| numbers(i).then_some("n");
    html! {
        div.scroll tabindex="0" {
            table {
                thead { tr { @for (i, head) in heads.iter().enumerate() { th class=[class(i)] scope="col" { (head) } } } }
                tbody {
                    @for row in rows {
                        tr { @for (i, cell) in row.iter().enumerate() { td class=[class(i)] { (cell) } } }
                    }
                }
            }
        }
    }
}

/// Plain text as a cell.
pub fn cell(text: impl AsRef<str>) -> Markup {
    html! { (text.as_ref()) }
}

/// A line that says why there is nothing to show.
pub fn nothing(why: &str) -> Markup {
    html! { p.nothing { (why) } }
}

/// Notes as a list with remedies. Remedies that name command-line flags are omitted: the page does not need the
/// command.
pub fn notes(notes: &[&Note]) -> Markup {
    html! {
        ul.notes {
            @for note in notes {
                li class=[note.is_warning().then_some("warning")] {
                    (sentence(&note.message))
                    @if let Some(remedy) = note.remedy.as_ref().filter(|remedy| !remedy.contains("--")) { " " span.remedy { (sentence(remedy)) } }
                }
            }
        }
    }
}

/// The text with a typographic minus before numbers; options such as `-c` are unchanged.
fn proper_minus(text: &str) -> String {
    let mut proper = String::with_capacity(text.len());
    let mut before = ' ';
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        let number = c == '-' && before == ' ' && chars.peek().is_some_and(char::is_ascii_digit);
        proper.push(if number { '−' } else { c });
        before = c;
    }
    proper
}

/// The text as a sentence, with capital and full stop. A leading name or path keeps its first letter.
fn sentence(text: &str) -> String {
    let text = quoted(&proper_minus(&readable(text.trim())));
    let first_word = text.split([' ', ',']).next().unwrap_or_default();
    let plain = !first_word.is_empty() && first_word.chars().all(|c| c.is_ascii_lowercase());
    let mut chars = text.chars();
    let mut sentence = match chars.next() {
        Some(c) if plain => format!("{}{}", c.to_ascii_uppercase(), chars.as_str()),
        _ => text.clone(),
    };
    if !sentence.is_empty() && !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}

/// The text with file names instead of paths, and numbers of at most five significant digits.
pub fn readable(text: &str) -> String {
    let word = |word: &str| {
        let core = word.trim_matches(['\'', '`', '(', ')', ',', ';', ':']);
        let file = core.rsplit(['/', '\\']).next().unwrap_or(core);
        let extension = file.rsplit_once('.').map_or("", |(_, extension)| extension);
        if file.len() < core.len() && extension.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return word.replace(core, file);
        }
        let digits = core.bytes().filter(u8::is_ascii_digit).count();
        match core.parse::<f64>() {
            Ok(x) if core.contains('.') && digits > 6 && x.is_finite() => {
                word.replace(core, &number::shortest(x, 5))
            }
            _ => word.to_owned(),
        }
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Backquotes replaced by quotation marks.
fn quoted(text: &str) -> String {
    let mut marks = ['‘', '’'].into_iter().cycle();
    text.chars().map(|c| if c == '`' { marks.next().unwrap_or(c) } else { c }).collect()
}
