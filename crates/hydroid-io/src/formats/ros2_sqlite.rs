//! Reader of the SQLite files of ROS 2 bags (rosbag2, `rosbag2_storage_sqlite3`): the tables `topics`, `messages`, and
//! since version 4 `message_definitions`.

use std::collections::HashMap;

use super::message::{Channel, Envelope, Output, Topics};
use super::sqlite::{Database, Rows, Table, Value, values};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary};

/// Columns of a table that are looked at.
const MOST_COLUMNS: usize = 16;

const REMEDY: &str = "recover the file with 'sqlite3 FILE .recover', or copy it again";

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let mut output = Output { sink, summary: Summary::default() };
    let mut database = Database::open(input, &mut output.summary)?;
    let mut bag = Bag { topics: Topics::new(), by_id: HashMap::new(), content: Vec::new() };
    let topics = table(&mut database, "topics", &mut output.summary)?;
    let messages = table(&mut database, "messages", &mut output.summary)?;
    bag.read_topics(&mut database, &topics, &mut output.summary)?;
    let columns = ["topic_id", "timestamp", "data"].map(|name| messages.column(name));
    let [Some(topic), Some(stamp), Some(data)] = columns else {
        return Err(database.input().damaged("the table 'messages' lacks a column", REMEDY));
    };
    let mut rows = Rows::new(&messages);
    bag.read_messages(&mut database, &mut rows, [topic, stamp, data], &mut output)?;
    if rows.damaged {
        let mut lost = Rows::lost();
        let found = bag.read_messages(&mut database, &mut lost, [topic, stamp, data], &mut output)?;
        output.summary.note(format!(
            "the table of messages is damaged; {found} messages were found outside of it and may be out of order"
        ));
    }
    Ok(output.summary)
}

fn table(database: &mut Database, name: &str, summary: &mut Summary) -> Result<Table, IoError> {
    if let Some(table) = database.table(name, summary)? {
        return Ok(table);
    }
    database.input().seek(0)?;
    let reason = format!("no table '{name}' is found: the file is damaged or no bag of ROS 2");
    Err(database.input().damaged(reason, REMEDY))
}

struct Bag {
    topics: Topics,
    /// Topic of each number.
    by_id: HashMap<i64, usize>,
    content: Vec<u8>,
}

impl Bag {
    fn read_topics(
        &mut self,
        database: &mut Database,
        topics: &Table,
        summary: &mut Summary,
    ) -> Result<(), IoError> {
        let mut definitions = HashMap::new();
        if let Some(table) = database.table("message_definitions", summary)? {
            let columns =
                ["topic_type", "encoding", "encoded_message_definition"].map(|name| table.column(name));
            self.read_texts(database, &table, columns, summary, |_, [name, encoding, text], topics, _| {
                if topics.spend(name.len() + 2 * text.len()).is_ok() {
                    definitions.insert(name, (encoding, text));
                }
            })?;
        }
        let columns = ["name", "type", "serialization_format"].map(|name| topics.column(name));
        let mut by_id = HashMap::new();
        self.read_texts(
            database,
            topics,
            columns,
            summary,
            |id, [topic, type_name, encoding], topics, summary| {
                let (definition_encoding, definition) =
                    definitions.get(&type_name).cloned().unwrap_or_default();
                let channel = Channel { topic, type_name, encoding, definition_encoding, definition };
                by_id.insert(id, topics.add(channel, summary));
            },
        )?;
        self.by_id = by_id;
        Ok(())
    }

    /// Gives the number and three texts of each row of a table.
    fn read_texts(
        &mut self,
        database: &mut Database,
        table: &Table,
        columns: [Option<usize>; 3],
        summary: &mut Summary,
        mut each: impl FnMut(i64, [String; 3], &mut Topics, &mut Summary),
    ) -> Result<(), IoError> {
        let mut rows = Rows::new(table);
        while let Some(cell) = database.next(&mut rows, summary)? {
            if !database.content(&rows, &cell, &mut self.content)? {
                summary.lose(rows.offset(database), 0, "a row of the table is not whole");
                continue;
            }
            let values = values(&self.content, MOST_COLUMNS);
            // The column of type INTEGER PRIMARY KEY is the number of the row.
            let texts = columns.map(|column| match column.and_then(|column| values.get(column)) {
                Some(Value::Text(text)) => String::from_utf8_lossy(text).into_owned(),
                _ => String::new(),
            });
            each(cell.rowid, texts, &mut self.topics, summary);
        }
        Ok(())
    }

    /// Gives the messages; the answer is their number.
    fn read_messages(
        &mut self,
        database: &mut Database,
        rows: &mut Rows,
        [topic, stamp, data]: [usize; 3],
        output: &mut Output,
    ) -> Result<u64, IoError> {
        let mut count = 0;
        while let Some(cell) = database.next(rows, &mut output.summary)? {
            database.input().tell(output.sink)?;
            let offset = rows.offset(database);
            let first = values(rows.beginning(&cell), MOST_COLUMNS);
            let Some(Value::Integer(topic)) = first.get(topic) else { continue };
            let Some(&topic) = self.by_id.get(topic) else {
                if !rows.are_lost() {
                    output.summary.lose(offset, 0, "a message of an unknown topic");
                }
                continue;
            };
            if !self.topics.needs(topic) {
                continue;
            }
            if !database.content(rows, &cell, &mut self.content)? {
                output.summary.lose(offset, 0, "a message is not whole");
                continue;
            }
            let values = values(&self.content, MOST_COLUMNS);
            if let (Some(&Value::Integer(received_ns)), Some(Value::Blob(data))) =
                (values.get(stamp), values.get(data))
            {
                count += 1;
                self.topics.message(topic, data, Envelope { received_ns, sent_ns: None, offset }, output);
            }
        }
        Ok(count)
    }
}
