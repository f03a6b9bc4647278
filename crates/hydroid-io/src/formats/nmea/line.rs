//! A line of a NMEA 0183 file.

use super::sentence::MOST_FIELDS;

/// A sentence and what is in front of it.
#[derive(Debug)]
pub(super) struct Line<'a> {
    pub(super) prefix: &'a [u8],
    /// Talker and formatter, or the name of a proprietary sentence.
    pub(super) address: &'a [u8],
    /// What follows the address, without the checksum.
    data: &'a [u8],
    pub(super) checksum: bool,
    /// Whether it begins with `!`: its fields are packed, as those of AIS.
    pub(super) packed: bool,
}

impl<'a> Line<'a> {
    /// Takes a line apart, or states what is wrong with it.
    pub(super) fn parse(line: &'a [u8]) -> Result<Self, &'static str> {
        // Without an early end, eight or more bytes are compared at once.
        if !line.iter().fold(true, |text, byte| text & ((b' '..=b'~').contains(byte) || *byte == b'\t')) {
            return Err("bytes that are not text");
        }
        let Some(start) = memchr::memchr2(b'$', b'!', line) else { return Err("a line without a sentence") };
        let sentence = line[start + 1..].trim_ascii_end();
        let star = memchr::memchr(b'*', sentence);
        let body = &sentence[..star.unwrap_or(sentence.len())];
        if let Some(star) = star {
            // Receivers of AIS add fields of their own behind the checksum.
            let (digits, rest) = sentence[star + 1..].split_at((sentence.len() - star - 1).min(2));
            let stated = hex(digits).filter(|_| rest.is_empty() || rest[0] == b',');
            let Some(stated) = stated else { return Err("a sentence that is cut") };
            if body.iter().fold(0, |sum, byte| sum ^ byte) != stated {
                return Err("a sentence with a wrong checksum");
            }
        }
        let comma = memchr::memchr(b',', body).unwrap_or(body.len());
        let address = &body[..comma];
        if address.len() < 3 || !address.iter().all(u8::is_ascii_alphanumeric) {
            return Err("a sentence without an address");
        }
        Ok(Self {
            prefix: &line[..start],
            address,
            data: body.get(comma + 1..).unwrap_or_default(),
            checksum: star.is_some(),
            packed: line[start] == b'!',
        })
    }

    /// Its fields and their number.
    pub(super) fn fields(&self) -> ([&'a [u8]; MOST_FIELDS], usize) {
        let mut fields = [&[][..]; MOST_FIELDS];
        let mut count = 0;
        for (field, place) in self.data.split(|byte| *byte == b',').zip(&mut fields) {
            *place = field;
            count += 1;
        }
        (fields, count)
    }

    pub(super) fn talker(&self) -> [u8; 2] {
        self.address.first_chunk().copied().unwrap_or_default()
    }

    /// The formatter of a sentence that is not proprietary.
    pub(super) fn formatter(&self) -> Option<[u8; 3]> {
        match self.address {
            [first, _, formatter @ ..] if *first != b'P' && !self.packed => formatter.try_into().ok(),
            _ => None,
        }
    }
}

fn hex(text: &[u8]) -> Option<u8> {
    let [high, low] = *text else { return None };
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    Some(digit(high)? << 4 | digit(low)?)
}

/// Whether a line has a sentence: `$` or `!`, an address of five characters or more, and a comma; a proprietary
/// address may be shorter.
pub(super) fn has_sentence(line: &[u8]) -> bool {
    memchr::memchr2(b'$', b'!', line).is_some_and(|start| {
        let sentence = &line[start + 1..];
        let size = sentence.iter().take_while(|byte| byte.is_ascii_alphanumeric()).count();
        sentence.get(size) == Some(&b',') && (size >= 5 || size >= 3 && sentence[0] == b'P')
    })
}
