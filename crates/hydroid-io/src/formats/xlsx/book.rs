//! Parts that the sheets refer to: ECMA-376 part 1, sections 18.2 (workbook), 18.4 (shared strings), 18.8 (styles).

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::rc::Rc;

use zip::ZipArchive;

use super::xml::{LONGEST_ATTRIBUTE, Step, Stop, Xml, attribute};

/// Size of a part that is small in any workbook.
const SMALL: u64 = 16 << 20;
/// Bytes of shared strings that are kept, and their number.
const MOST_TEXT: usize = 64 << 20;
const MOST_STRINGS: usize = 8 << 20;
const MOST_SHEETS: usize = 1024;
const MOST_STYLES: usize = 1 << 16;

/// What a number is by its format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    Number,
    Date,
    /// A time of the day, or a duration.
    Time,
}

/// A sheet, and its part.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) name: String,
    pub(super) part: String,
}

/// What is known before the sheets are read.
#[derive(Debug, Default)]
pub(super) struct Book {
    pub(super) sheets: Vec<Sheet>,
    /// Days are counted from 1904.
    pub(super) since_1904: bool,
    pub(super) styles: Vec<Style>,
    pub(super) strings: Strings,
}

/// Shared strings, one behind the other.
#[derive(Debug, Default)]
pub(super) struct Strings {
    text: String,
    ends: Vec<usize>,
    /// Not all are kept.
    pub(super) cut: bool,
}

impl Strings {
    pub(super) fn get(&self, index: usize) -> Option<&str> {
        let start = index.checked_sub(1).map_or(Some(0), |before| self.ends.get(before).copied())?;
        self.text.get(start..*self.ends.get(index)?)
    }
}

/// The package, and the bytes of XML that its parts may hold together.
pub(super) struct Package<F> {
    zip: ZipArchive<F>,
    left: Rc<Cell<u64>>,
}

impl<F: Read + Seek> Package<F> {
    /// Of a file of this length. Sheets of equal rows pack 12 to 1, bombs up to 1000 to 1. Parts may have the same
    /// place in the file, so the limit is that of the file.
    pub(super) fn new(zip: ZipArchive<F>, length: u64) -> Self {
        Self { zip, left: Rc::new(Cell::new(length.saturating_mul(100).saturating_add(SMALL))) }
    }

    /// A part, with its place in the file and its length there, as the directory says.
    pub(super) fn part(&mut self, name: &str) -> Option<(Xml<impl Read + use<'_, F>>, u64, u64)> {
        let content = self.zip.by_name(name).ok()?;
        let (start, size) = (content.data_start().unwrap_or(0), content.compressed_size());
        Some((Xml::new(content, Rc::clone(&self.left)), start, size))
    }
}

/// Parses the parts. `None` if the file is not a workbook.
pub(super) fn load<F: Read + Seek>(package: &mut Package<F>) -> Result<Option<Book>, Stop> {
    let root =
        relations(package, "_rels/.rels")?.into_iter().find(|link| link.kind.ends_with("/officeDocument"));
    let path = root.map_or("xl/workbook.xml".to_owned(), |link| resolve("", &link.target));
    let (folder, file) = path.rsplit_once('/').unwrap_or(("", &path));
    let mut book = Book::default();
    let mut sheets = Vec::new();
    let mut is_workbook = false;
    let found = each(package, &path, |step| {
        if let Step::Open(tag, _) = step {
            match tag.local_name().as_ref() {
                "workbook" => is_workbook = true,
                "workbookPr" => {
                    book.since_1904 = matches!(attribute(tag, "date1904").as_deref(), Some("1" | "true"));
                }
                "sheet" if sheets.len() < MOST_SHEETS => {
                    // Two attributes are named `id`: the one with a prefix refers to the part.
                    let id = tag.attributes().with_checks(false).flatten().find(|known| {
                        known.key.prefix().is_some()
                            && known.key.local_name().as_ref() == "id"
                            && known.value.len() <= LONGEST_ATTRIBUTE
                    });
                    sheets.push((
                        attribute(tag, "name").unwrap_or_default(),
                        id.map(|id| id.value.into_owned()),
                    ));
                }
                _ => {}
            }
        }
    })?;
    if !found || !is_workbook {
        return Ok(None);
    }
    let links = relations(package, &resolve(folder, &format!("_rels/{file}.rels")))?;
    for (name, id) in sheets {
        match links.iter().find(|link| Some(&link.id) == id.as_ref()) {
            Some(link) if link.kind.ends_with("/worksheet") => {
                book.sheets.push(Sheet { name, part: resolve(folder, &link.target) });
            }
            // A sheet of another kind, such as a chart.
            Some(_) => {}
            // No part has this name: the sheet is stated as lost.
            None => book.sheets.push(Sheet { name, part: String::new() }),
        }
    }
    let part = |kind: &str, usual: &str| {
        let link = links.iter().find(|link| link.kind.ends_with(kind));
        resolve(folder, link.map_or(usual, |link| &link.target))
    };
    book.styles = styles(package, &part("/styles", "styles.xml"))?;
    book.strings = strings(package, &part("/sharedStrings", "sharedStrings.xml"))?;
    Ok(Some(book))
}

/// Gives the steps of a part; false if there is no such part.
fn each<F: Read + Seek>(
    package: &mut Package<F>,
    part: &str,
    mut take: impl FnMut(&Step<'_>),
) -> Result<bool, Stop> {
    let Some((mut xml, ..)) = package.part(part) else { return Ok(false) };
    loop {
        let end = xml.next(|step| {
            take(&step);
            matches!(step, Step::End)
        })?;
        if end {
            return Ok(true);
        }
    }
}

/// A reference to a part (ECMA-376 part 2, "Relationships").
struct Link {
    id: String,
    kind: String,
    target: String,
}

fn relations<F: Read + Seek>(package: &mut Package<F>, part: &str) -> Result<Vec<Link>, Stop> {
    let mut links = Vec::new();
    each(package, part, |step| {
        if let Step::Open(tag, _) = step
            && tag.local_name().as_ref() == "Relationship"
            && links.len() < 2 * MOST_SHEETS
        {
            let [id, kind, target] =
                ["Id", "Type", "Target"].map(|name| attribute(tag, name).unwrap_or_default());
            links.push(Link { id, kind, target });
        }
    })?;
    Ok(links)
}

/// Name of a part that a part in a folder refers to.
fn resolve(folder: &str, target: &str) -> String {
    if let Some(absolute) = target.strip_prefix('/') {
        return absolute.to_owned();
    }
    let mut path: Vec<&str> = folder.split('/').filter(|name| !name.is_empty()).collect();
    for name in target.split('/') {
        match name {
            "." | "" => {}
            ".." => drop(path.pop()),
            _ => path.push(name),
        }
    }
    path.join("/")
}

fn styles<F: Read + Seek>(package: &mut Package<F>, part: &str) -> Result<Vec<Style>, Stop> {
    let mut custom = BTreeMap::new();
    let mut styles = Vec::new();
    let mut in_cells = false;
    each(package, part, |step| match step {
        Step::Open(tag, _) => match tag.local_name().as_ref() {
            "cellXfs" => in_cells = true,
            "numFmt" if custom.len() < MOST_STYLES => {
                let id: Option<u32> = attribute(tag, "numFmtId").and_then(|id| id.parse().ok());
                custom.extend(id.zip(attribute(tag, "formatCode").map(|code| format(&code))));
            }
            "xf" if in_cells && styles.len() < MOST_STYLES => {
                let id = attribute(tag, "numFmtId").and_then(|id| id.parse().ok()).unwrap_or(0);
                let known = custom.get(&id).copied();
                styles.push(known.unwrap_or_else(|| builtin(id)));
            }
            _ => {}
        },
        Step::Close(b"cellXfs") => in_cells = false,
        _ => {}
    })?;
    Ok(styles)
}

/// Formats that are not written in the file (section 18.8.30).
fn builtin(id: u32) -> Style {
    match id {
        14..=17 | 22 => Style::Date,
        18..=21 | 45..=47 => Style::Time,
        _ => Style::Number,
    }
}

/// Kind of a format by its letters (section 18.8.31); quoted and escaped ones have no meaning.
fn format(code: &str) -> Style {
    let (mut day, mut time, mut m) = (false, false, false);
    let mut letters = code.chars();
    while let Some(letter) = letters.next() {
        match letter.to_ascii_lowercase() {
            '"' => drop(letters.find(|letter| *letter == '"')),
            '\\' | '_' | '*' => drop(letters.next()),
            '[' => {
                let content: String = letters.by_ref().take_while(|letter| *letter != ']').collect();
                time |= content.to_ascii_lowercase().trim_matches(['h', 'm', 's']).is_empty();
            }
            // The second section is for negative numbers.
            ';' => break,
            'd' | 'y' => day = true,
            'h' | 's' => time = true,
            'm' => m = true,
            _ => {}
        }
    }
    if day || (m && !time) {
        Style::Date
    } else if time {
        Style::Time
    } else {
        Style::Number
    }
}

fn strings<F: Read + Seek>(package: &mut Package<F>, part: &str) -> Result<Strings, Stop> {
    let mut strings = Strings::default();
    let (mut in_text, mut in_phonetic) = (false, false);
    each(package, part, |step| match step {
        Step::Open(tag, closed) => match tag.local_name().as_ref() {
            "t" => in_text = !closed,
            "rPh" => in_phonetic = !closed,
            "si" if *closed && strings.ends.len() < MOST_STRINGS => strings.ends.push(strings.text.len()),
            _ => {}
        },
        Step::Close(b"t") => in_text = false,
        Step::Close(b"rPh") => in_phonetic = false,
        Step::Close(b"si") => {
            if strings.ends.len() < MOST_STRINGS {
                strings.ends.push(strings.text.len());
            } else {
                strings.cut = true;
            }
        }
        Step::Text(text) if in_text && !in_phonetic => {
            if strings.text.len() + text.len() <= MOST_TEXT {
                strings.text.push_str(text);
            } else {
                strings.cut = true;
            }
        }
        _ => {}
    })?;
    Ok(strings)
}
