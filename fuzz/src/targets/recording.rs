//! Logs of other programs: every format of `hydroid-io`.

use hydroid_io::{LogFile, Sink, Topic};

/// Number of fields of each topic, and whether its rows have a stamp of reception.
#[derive(Default)]
struct Checked(Vec<(usize, Option<bool>)>);

impl Sink for Checked {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        assert!(id <= self.0.len(), "topics are numbered in order");
        if id == self.0.len() {
            self.0.push((0, None));
        }
        assert!(topic.fields.len() >= self.0[id].0, "{}: fields are added", topic.name);
        self.0[id].0 = topic.fields.len();
        true
    }

    fn row(&mut self, id: usize, _: i64, received_ns: Option<i64>, values: &[f64]) {
        let (fields, received) = &mut self.0[id];
        assert_eq!(values.len(), *fields, "a value for each field");
        let first = received.get_or_insert(received_ns.is_some());
        assert_eq!(*first, received_ns.is_some(), "a stamp of reception for each row or for none");
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        assert!(done <= total, "{done} of {total} bytes");
        true
    }
}

/// A recording has a value for each field of a row, and its losses lie in the file.
pub fn recording(bytes: &[u8]) {
    let file = LogFile::in_memory("recording", bytes);
    let Ok(summary) = hydroid_io::scan(&file, &mut Checked::default()) else { return };
    let losses = &summary.losses;
    assert!(losses.len() as u64 <= summary.lost_parts);
    assert!(losses.iter().all(|loss| loss.offset <= bytes.len() as u64), "{losses:?}");
}
