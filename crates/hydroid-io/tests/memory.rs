//! The memory of reading whatever a file unpacks to: a counting allocator. The counter is global, so there is only one
//! test.
#![allow(unsafe_code)] // an allocator can be written in no other way

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use hydroid_io::{Sink, Summary, Topic, scan};

struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn add(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(held, Ordering::Relaxed);
}

// SAFETY: every call is forwarded to the system allocator. A reallocation is one of the default: a new part of memory,
// and the old one until it is copied.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: the contract of the caller is forwarded.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the contract of the caller is forwarded.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The largest part of a file that is unpacked, less some room for heads.
const PART: usize = (256 << 20) - (1 << 20);

/// A frame of Zstandard (RFC 8878, section 3.1.1): these bytes, and zeros behind them up to `size` bytes.
fn zstd(bytes: &[u8], size: usize) -> Vec<u8> {
    const LARGEST_BLOCK: usize = 128 << 10;
    // A window of 64 MiB.
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, 0x80];
    let mut block = |kind: usize, size: usize, last: bool, content: &[u8]| {
        let head = size << 3 | kind << 1 | usize::from(last);
        frame.extend_from_slice(&head.to_le_bytes()[..3]);
        frame.extend_from_slice(content);
    };
    for part in bytes.chunks(LARGEST_BLOCK) {
        block(0, part.len(), false, part);
    }
    let mut left = size - bytes.len();
    while left > LARGEST_BLOCK {
        block(1, LARGEST_BLOCK, false, &[0]);
        left -= LARGEST_BLOCK;
    }
    block(1, left, true, &[0]);
    frame
}

fn text(text: &str) -> Vec<u8> {
    [&u32::try_from(text.len()).unwrap().to_le_bytes()[..], text.as_bytes()].concat()
}

/// A record of MCAP of which the file has the beginning, and its length.
fn record(opcode: u8, length: usize, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(length as u64).to_le_bytes(), body].concat()
}

fn chunk(compression: &str, unpacked: usize, packed: &[u8]) -> Vec<u8> {
    let head = [&[0; 16][..], &(unpacked as u64).to_le_bytes(), &[0; 4], &text(compression)].concat();
    let body = [&head[..], &(packed.len() as u64).to_le_bytes(), packed].concat();
    record(6, body.len(), &body)
}

/// An array of bytes and a number, packed.
fn message() -> Vec<u8> {
    let count = u32::try_from(PART - 9).unwrap();
    let data = zstd(&[&[0, 1, 0, 0][..], &count.to_le_bytes()].concat(), PART);
    let body = [&[1, 0][..], &[0; 4], &[1, 0, 0, 0, 0, 0, 0, 0].repeat(2), &data].concat();
    record(5, body.len(), &body)
}

#[derive(Default)]
struct Rows(u64);

impl Sink for Rows {
    fn topic(&mut self, _: usize, _: &Topic) -> bool {
        true
    }

    fn row(&mut self, _: usize, _: i64, _: Option<i64>, _: &[f64]) {
        self.0 += 1;
    }
}

/// Number of rows and the summary of a file with these records, which needs less than 1 GB.
fn read(records: &[Vec<u8>]) -> (u64, Summary) {
    let schema = [&[1, 0][..], &text("p/msg/X"), &text("ros2msg"), &text("uint8[] data\nuint8 end")].concat();
    let channel = [&[1, 0, 1, 0][..], &text("/x"), &text("cdr"), &[0; 4]].concat();
    let head = [record(3, schema.len(), &schema), record(4, channel.len(), &channel)].concat();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), [b"\x89MCAP0\r\n", &head[..], &records.concat()].concat()).unwrap();
    let before = HELD.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let mut rows = Rows::default();
    let summary = scan(file.path().to_str().unwrap(), &mut rows).unwrap();
    let peak = PEAK.load(Ordering::Relaxed) - before;
    assert!((512 << 20..1_000_000_000).contains(&peak), "{peak} bytes of memory");
    (rows.0, summary)
}

#[test]
fn unpacking_needs_less_than_a_gigabyte_and_ends() {
    // The largest message in the largest chunk. Without the attachment the file may not unpack to that much.
    let message = message();
    let zeros = PART - message.len() - 9;
    let largest = zstd(&[&message[..], &record(0x80, zeros, &[])].concat(), PART);
    let attachment = record(9, 2 << 20, &vec![0; 2 << 20]);
    let (rows, summary) = read(&[attachment, chunk("zstd", PART, &largest), chunk("zstd", PART, &largest)]);
    assert_eq!((rows, summary.lost_parts), (2, 0), "{summary:?}");

    // Messages that are packed in packed chunks: 8 TB of 100 kB.
    let many = message.repeat(PART / message.len());
    let packed = ruzstd::encoding::compress_to_vec(&many[..], ruzstd::encoding::CompressionLevel::Fastest);
    assert!(packed.len() < 1 << 20, "{}", packed.len());
    let (rows, summary) = read(&[chunk("zstd", many.len(), &packed)]);
    assert!(rows < 10, "{rows}");
    assert!(summary.losses.iter().any(|loss| loss.reason.contains("1,000 times its length")), "{summary:?}");
}
