//! Tables of SQLite files (SQLite documentation, "Database File Format"), read without a change to the file. Rows come
//! in the order of their numbers; pages that are damaged are left out.

mod row;
mod wal;

pub(crate) use self::row::{Value, values};
use self::row::{columns, varint};
use self::wal::Wal;
use crate::error::IoError;
use crate::input::{Input, LARGEST_PART};
use crate::log_file::LogFile;
use crate::sink::Summary;

/// Length of the header of the file (section 1.3).
const HEADER: usize = 100;

const INTERIOR: u8 = 0x05;
const LEAF: u8 = 0x0d;

/// A file with what its write-ahead log adds.
pub(crate) struct Database<'a> {
    input: &'a mut Input,
    wal: Option<Wal>,
    page_size: usize,
    /// Bytes of a page without the reserved ones at its end.
    usable: usize,
    pages: u64,
    /// A bit for each page that belongs to a table that has been read.
    seen: Vec<u64>,
    /// A bit for each page that has been read as the rest of a row. Each is that of one row, so rows whose pages are
    /// linked in a circle or to each other end, and the work is bounded by the length of the file.
    chained: Vec<u64>,
}

/// A table: the page of its root and the names of its columns.
#[derive(Debug)]
pub(crate) struct Table {
    root: u64,
    columns: Vec<String>,
}

impl Table {
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.eq_ignore_ascii_case(name))
    }
}

/// Where the reading of a table is.
pub(crate) struct Rows {
    /// Pages to read, the next one at the end.
    stack: Vec<u64>,
    page: Vec<u8>,
    number: u64,
    cell: usize,
    cells: usize,
    /// Bytes of the page that its next rows may have. Rows lie beside each other, so all of them fit into the page.
    room: usize,
    /// For a search of lost rows: the next page.
    salvage: Option<u64>,
    /// Whether a page of the table was damaged.
    pub(crate) damaged: bool,
}

/// A row: its number, and where its content is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub(crate) rowid: i64,
    /// Bytes of the content.
    size: usize,
    from: usize,
    to: usize,
    /// Page with the rest of the content.
    overflow: u64,
}

impl<'a> Database<'a> {
    /// Opens a file. A part of it that is missing, and a transaction that was not finished, are stated.
    pub(crate) fn open(input: &'a mut Input, summary: &mut Summary) -> Result<Self, IoError> {
        let remedy = "copy the file again, or recover it with 'sqlite3 FILE .recover'";
        let Some(header) = input.window(HEADER)?.first_chunk::<HEADER>().copied() else {
            return Err(input.damaged("the file ends in its header", remedy));
        };
        let number = |at: usize| u64::from(big(&header[at..]).unwrap_or(0));
        let page_size = match usize::from(u16::from_be_bytes([header[16], header[17]])) {
            1 => 1 << 16,
            size => size,
        };
        let usable = page_size.saturating_sub(usize::from(header[20]));
        if !page_size.is_power_of_two() || page_size < 512 || usable < 480 {
            return Err(input.damaged("the header has an impossible size of pages", remedy));
        }
        if number(56) > 1 {
            return Err(
                input.damaged("texts in UTF-16 are not supported", "convert the file with ros2 bag convert")
            );
        }
        let wal = Wal::open(input.source(), page_size, summary)?;
        let stored = input.length() / page_size as u64;
        let stated = number(28);
        // The stated number holds if the change counters agree (section 1.3.7), and there is no log.
        let valid = wal.is_none() && header[24..28] == header[92..96];
        if valid && stated > stored {
            let bytes = (stated * page_size as u64).saturating_sub(input.length());
            summary.lose(input.length(), bytes, "the file is shorter than it states");
        }
        let journal = input.source().beside("-journal");
        let is_long =
            |of: &LogFile| of.open().and_then(|file| file.length()).is_ok_and(|length| length > 512);
        if let Some(journal) = journal.filter(is_long) {
            summary.note(format!(
                "{} has a change that was not finished and is not undone here; open the bag once with sqlite3",
                journal.name()
            ));
        }
        // The log may state more pages than there are.
        let all = wal.as_ref().map_or(0, |wal| wal.pages().min(stored.saturating_add(wal.stored())));
        let pages = stored.max(all).min(u64::from(u32::MAX));
        Ok(Self { input, wal, page_size, usable, pages, seen: Vec::new(), chained: Vec::new() })
    }

    pub(crate) fn input(&mut self) -> &mut Input {
        self.input
    }

    /// Place of a page in the file.
    fn offset(&self, page: u64) -> u64 {
        page.saturating_sub(1).saturating_mul(self.page_size as u64)
    }

    /// Place of a page for the statement of a loss: a page may be in the log alone.
    fn stated(&self, page: u64) -> u64 {
        self.offset(page).min(self.input.length())
    }

    /// The tables of these names, where the file has them.
    pub(crate) fn tables<const N: usize>(
        &mut self,
        names: [&str; N],
        summary: &mut Summary,
    ) -> Result<[Option<Table>; N], IoError> {
        let mut rows = Rows::of(1);
        let mut content = Vec::new();
        let mut tables = [const { None }; N];
        while let Some(cell) = self.next(&mut rows, summary)? {
            let whole = self.content(&rows, &cell, &mut content)?;
            // Columns: type, name, tbl_name, rootpage, sql (section 2.6).
            let values = if whole { values(&content, 5) } else { Vec::new() };
            let [kind, found, _, root, sql] = values[..] else {
                summary.lose(rows.offset(self), 0, "a row of the table of all tables is not whole");
                continue;
            };
            if let (Value::Text(b"table"), Value::Text(found), Value::Integer(root), Value::Text(sql)) =
                (kind, found, root, sql)
                && let Some(at) = names.iter().position(|name| found.eq_ignore_ascii_case(name.as_bytes()))
                && let Ok(root) = u64::try_from(root)
                && tables[at].is_none()
            {
                tables[at] = Some(Table { root, columns: columns(&String::from_utf8_lossy(sql)) });
            }
        }
        Ok(tables)
    }

    /// Moves to the next row of a table.
    pub(crate) fn next(&mut self, rows: &mut Rows, summary: &mut Summary) -> Result<Option<Cell>, IoError> {
        loop {
            while rows.cell < rows.cells {
                let cell = self.cell(rows).filter(|cell| cell.to - cell.from <= rows.room);
                rows.cell += 1;
                match cell {
                    Some(cell) => {
                        rows.room -= cell.to - cell.from;
                        return Ok(Some(cell));
                    }
                    None if rows.salvage.is_none() => {
                        rows.damaged = true;
                        summary.lose(self.stated(rows.number), 0, "a row of the table is damaged");
                    }
                    None => {}
                }
            }
            let Some(number) = self.next_page(rows, summary) else { return Ok(None) };
            rows.number = number;
            (rows.cell, rows.cells) = (0, 0);
            let whole = self.page(number, &mut rows.page)?;
            rows.room = rows.page.len();
            let head = if number == 1 { HEADER } else { 0 };
            let count = rows
                .page
                .get(head + 3..head + 5)
                .map_or(0, |b| usize::from(u16::from_be_bytes([b[0], b[1]])));
            match rows.page.get(head) {
                Some(&LEAF) => rows.cells = count,
                Some(&INTERIOR) if rows.salvage.is_none() => self.children(rows, head, count, summary),
                _ if rows.salvage.is_some() => {}
                _ => {
                    rows.damaged = true;
                    if whole {
                        let size = self.page_size as u64;
                        summary.lose(self.stated(number), size, "a page of the table is damaged");
                    }
                }
            }
        }
    }

    fn next_page(&mut self, rows: &mut Rows, summary: &mut Summary) -> Option<u64> {
        let Some(next) = &mut rows.salvage else {
            let page = rows.stack.pop()?;
            // The root is as the table of tables says, which may be wrong.
            if !(1..=self.pages).contains(&page) {
                rows.damaged = true;
                summary.lose(self.input.length(), 0, "the first page of a table is outside of the file");
                return None;
            }
            mark(&mut self.seen, page);
            return Some(page);
        };
        while *next <= self.pages {
            let page = *next;
            *next += 1;
            if mark(&mut self.seen, page) {
                return Some(page);
            }
        }
        None
    }

    /// Puts the pages below an interior page on the stack (section 1.6). A page is read once, so a circle ends.
    fn children(&mut self, rows: &mut Rows, head: usize, count: usize, summary: &mut Summary) {
        let pointers = rows.page.get(head + 12..).unwrap_or_default();
        let right = big(rows.page.get(head + 8..).unwrap_or_default());
        let cells = pointers.as_chunks::<2>().0.iter().take(count);
        let left = cells.filter_map(|at| big(rows.page.get(usize::from(u16::from_be_bytes(*at))..)?));
        let first = rows.stack.len();
        for page in left.chain(right).map(u64::from) {
            if page > 0 && page <= self.pages && mark(&mut self.seen, page) {
                rows.stack.push(page);
            }
        }
        if rows.stack.len() - first <= count {
            rows.damaged = true;
            let reason =
                "a page of the table refers to pages outside of the file, or to pages that have been read";
            summary.lose(self.stated(rows.number), 0, reason);
        }
        rows.stack[first..].reverse();
    }

    /// A cell of a leaf page.
    fn cell(&self, rows: &Rows) -> Option<Cell> {
        let head = if rows.number == 1 { HEADER } else { 0 };
        let at = rows.page.get(head + 8 + 2 * rows.cell..)?.first_chunk()?;
        let at = usize::from(u16::from_be_bytes(*at));
        let mut rest = rows.page.get(at..self.usable)?;
        let size = usize::try_from(varint(&mut rest)?).ok()?;
        let rowid = varint(&mut rest)?.cast_signed();
        let from = self.usable - rest.len();
        let most = self.usable - 35;
        let local = if size <= most {
            size
        } else {
            let least = (self.usable - 12) * 32 / 255 - 23;
            let fitting = least + (size - least) % (self.usable - 4);
            if fitting <= most { fitting } else { least }
        };
        let behind = rest.get(local..)?;
        let overflow = if local < size { u64::from(big(behind)?) } else { 0 };
        Some(Cell { rowid, size, from, to: from + local, overflow })
    }

    /// The content of a row with its overflow pages; the answer is whether all of it is there.
    pub(crate) fn content(
        &mut self,
        rows: &Rows,
        cell: &Cell,
        content: &mut Vec<u8>,
    ) -> Result<bool, IoError> {
        content.clear();
        content.extend_from_slice(rows.beginning(cell));
        // A row is not longer than the file.
        let most = (LARGEST_PART as u64 / 2).min(self.pages.saturating_mul(self.page_size as u64));
        if cell.size as u64 > most {
            return Ok(false);
        }
        let mut page = Vec::new();
        let mut next = cell.overflow;
        while content.len() < cell.size {
            if !(1..=self.pages).contains(&next)
                || !mark(&mut self.chained, next)
                || !self.page(next, &mut page)?
            {
                return Ok(false);
            }
            mark(&mut self.seen, next);
            next = big(&page).map_or(0, u64::from);
            let part = page.get(4..self.usable).unwrap_or_default();
            content.extend_from_slice(&part[..part.len().min(cell.size - content.len())]);
        }
        Ok(true)
    }

    /// Reads a page; the answer is whether it is there.
    fn page(&mut self, number: u64, page: &mut Vec<u8>) -> Result<bool, IoError> {
        page.clear();
        let offset = self.offset(number);
        let logged = self.wal.as_mut().and_then(|wal| wal.find(number));
        let (input, offset) = match logged {
            Some((input, offset)) => (input, offset),
            None => (&mut *self.input, offset),
        };
        // Pages may come in any order, so nothing beyond the page is read.
        input.read_at(offset, self.page_size, page)?;
        if page.len() < self.page_size {
            page.clear();
            return Ok(false);
        }
        input.seek(offset + self.page_size as u64)?;
        Ok(true)
    }
}

impl Rows {
    fn of(root: u64) -> Self {
        let (stack, page) = (vec![root], Vec::new());
        Self { stack, page, number: 0, cell: 0, cells: 0, room: 0, salvage: None, damaged: false }
    }

    /// The rows of a table.
    pub(crate) fn new(table: &Table) -> Self {
        Self::of(table.root)
    }

    /// The rows in all pages that belong to no table that has been read.
    pub(crate) fn lost() -> Self {
        Self { stack: Vec::new(), salvage: Some(2), ..Self::of(0) }
    }

    /// The first bytes of a row, which are in its page.
    pub(crate) fn beginning(&self, cell: &Cell) -> &[u8] {
        self.page.get(cell.from..cell.to).unwrap_or_default()
    }

    /// Whether these are lost rows, which may be those of other tables.
    pub(crate) fn are_lost(&self) -> bool {
        self.salvage.is_some()
    }

    /// Place of the page in the file, for the statement of a loss.
    pub(crate) fn offset(&self, database: &Database) -> u64 {
        database.stated(self.number)
    }
}

/// Sets the bit of a page of the file; the answer is whether it was not set.
fn mark(seen: &mut Vec<u64>, page: u64) -> bool {
    let Ok(word) = usize::try_from(page / 64) else { return false };
    if seen.len() <= word {
        seen.resize(word + 1, 0);
    }
    let bit = 1 << (page % 64);
    let new = seen[word] & bit == 0;
    seen[word] |= bit;
    new
}

/// A number of four bytes.
fn big(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}
