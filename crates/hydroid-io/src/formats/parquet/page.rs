//! Header of a page: Apache Parquet format, `parquet.thrift`, `PageHeader`.

use super::thrift::{Kind, Part, STRUCT, Thrift};

/// Kind of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum PageKind {
    Data,
    /// Sizes of the levels, which are in front of the values and never compressed.
    DataV2 {
        repetition: usize,
        definition: usize,
        packed: bool,
    },
    Dictionary,
    /// An index, or a kind of the future.
    #[default]
    Other,
}

/// Header of a page.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PageHeader {
    pub(super) kind: PageKind,
    /// Size of the header itself.
    pub(super) size: usize,
    pub(super) unpacked: usize,
    pub(super) packed: usize,
    pub(super) crc: Option<i64>,
    pub(super) values: u64,
    pub(super) encoding: i64,
    /// Encoding of the definition levels.
    pub(super) levels: i64,
}

impl PageHeader {
    pub(super) fn parse(data: &[u8]) -> Part<Self> {
        let mut thrift = Thrift::new(data);
        let mut header = Self { encoding: -1, levels: 3, ..Self::default() };
        let mut number = -1;
        let mut id = 0;
        while let Some(kind) = thrift.member(&mut id)? {
            match id {
                1 => number = thrift.integer(kind)?,
                2 => header.unpacked = size(&mut thrift, kind)?,
                3 => header.packed = size(&mut thrift, kind)?,
                4 => header.crc = Some(thrift.integer(kind)? & 0xffff_ffff),
                5 | 7 | 8 if kind == STRUCT => header.content(&mut thrift, id)?,
                _ => thrift.skip(kind)?,
            }
        }
        let fits = matches!(
            (number, header.kind),
            (0, PageKind::Data)
                | (2, PageKind::Dictionary)
                | (3, PageKind::DataV2 { .. })
                | (_, PageKind::Other)
        );
        if !fits || (header.kind == PageKind::Other && matches!(number, 0 | 2 | 3)) {
            return Err("a page has not the header of its type");
        }
        header.size = thrift.at();
        Ok(header)
    }

    /// `DataPageHeader` (5), `DictionaryPageHeader` (7), `DataPageHeaderV2` (8).
    fn content(&mut self, thrift: &mut Thrift<'_>, number: i16) -> Part<()> {
        let (mut repetition, mut definition, mut packed) = (0, 0, true);
        let mut id = 0;
        while let Some(kind) = thrift.member(&mut id)? {
            match (number, id) {
                (_, 1) => self.values = thrift.count(kind)?,
                (5 | 7, 2) | (8, 4) => self.encoding = thrift.integer(kind)?,
                (5, 3) => self.levels = thrift.integer(kind)?,
                (8, 5) => definition = size(thrift, kind)?,
                (8, 6) => repetition = size(thrift, kind)?,
                (8, 7) => packed = Thrift::truth(kind)?,
                _ => thrift.skip(kind)?,
            }
        }
        self.kind = match number {
            5 => PageKind::Data,
            7 => PageKind::Dictionary,
            _ => PageKind::DataV2 { repetition, definition, packed },
        };
        Ok(())
    }
}

fn size(thrift: &mut Thrift<'_>, kind: Kind) -> Part<usize> {
    usize::try_from(thrift.integer(kind)?).map_err(|_| "a size is negative")
}
