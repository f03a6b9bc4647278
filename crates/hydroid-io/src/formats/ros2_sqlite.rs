//! Reader of the SQLite files of ROS 2 bags (rosbag2, `rosbag2_storage_sqlite3`): the tables `topics`, `messages`, and
//! since version 4 `message_definitions`.

use std::collections::{BTreeMap, HashMap};

use super::message::{Channel, Envelope, LONGEST_DEFINITION, LONGEST_TOPIC, Output, Topics, text};
use super::sqlite::{Database, Rows, Table, Value, values};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Sink, Summary};

const REMEDY: &str = "recover the file with 'sqlite3 FILE .recover', or copy it again";

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let mut output = Output { sink, summary: Summary::default() };
    let length = input.length();
    let mut database = Database::open(input, &mut output.summary)?;
    let mut bag = Bag { topics: Topics::new(length), by_id: HashMap::new(), content: Vec::new() };
    let names = ["topics", "messages", "message_definitions"];
    let [topics, messages, definitions] = database.tables(names, &mut output.summary)?;
    let topics = needed(&mut database, "topics", topics)?;
    let messages = needed(&mut database, "messages", messages)?;
    let columns = needed_columns(&mut database, "messages", &messages, ["topic_id", "timestamp", "data"])?;
    bag.read_topics(&mut database, &topics, definitions.as_ref(), &mut output.summary)?;
    let mut rows = Rows::new(&messages);
    bag.read_messages(&mut database, &mut rows, columns, &mut output)?;
    if rows.damaged {
        let mut lost = Rows::lost();
        let found = bag.read_messages(&mut database, &mut lost, columns, &mut output)?;
        output.summary.note(format!(
            "the table of messages is damaged; {found} messages were found outside of it and may be out of order"
        ));
    }
    Ok(output.summary)
}

fn needed(database: &mut Database, name: &str, table: Option<Table>) -> Result<Table, IoError> {
    if let Some(table) = table {
        return Ok(table);
    }
    database.input().seek(0)?;
    let reason = format!("no table '{name}' is found: the file is damaged or no bag of ROS 2");
    Err(database.input().damaged(reason, REMEDY))
}

fn needed_columns<const N: usize>(
    database: &mut Database,
    name: &str,
    table: &Table,
    columns: [&str; N],
) -> Result<[usize; N], IoError> {
    let mut found = [0; N];
    for (found, column) in found.iter_mut().zip(columns) {
        *found = table.column(column).ok_or_else(|| {
            database.input().damaged(format!("the table '{name}' lacks the column '{column}'"), REMEDY)
        })?;
    }
    Ok(found)
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
        definitions: Option<&Table>,
        summary: &mut Summary,
    ) -> Result<(), IoError> {
        let columns = needed_columns(database, "topics", topics, ["name", "type", "serialization_format"])?;
        let mut stored = HashMap::new();
        if let Some(table) = definitions {
            let columns = ["topic_type", "encoding", "encoded_message_definition"];
            let columns = needed_columns(database, "message_definitions", table, columns)?;
            self.read_texts(database, table, columns, summary, |_, [name, encoding, text], topics, _| {
                let size = size_of::<[String; 3]>() + name.len() + encoding.len() + text.len();
                if topics.spend(3 * size).is_ok() {
                    stored.insert(name, (encoding, text));
                }
            })?;
        }
        let mut by_id = HashMap::new();
        self.read_texts(
            database,
            topics,
            columns,
            summary,
            |id, [topic, type_name, encoding], topics, summary| {
                let (definition_encoding, definition) = stored.get(&type_name).cloned().unwrap_or_default();
                let units = BTreeMap::new();
                let channel = Channel { topic, type_name, encoding, definition_encoding, definition, units };
                let topic = topics.add(channel, summary);
                if topics.spend(size_of::<(i64, usize)>()).is_ok() {
                    by_id.insert(id, topic);
                }
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
        columns: [usize; 3],
        summary: &mut Summary,
        mut each: impl FnMut(i64, [String; 3], &mut Topics, &mut Summary),
    ) -> Result<(), IoError> {
        let mut rows = Rows::new(table);
        while let Some(cell) = database.next(&mut rows, summary)? {
            if !database.content(&rows, &cell, &mut self.content)? {
                summary.lose(rows.offset(database), 0, "a row of the table is not whole");
                continue;
            }
            let values = values(&self.content, behind(columns));
            let [Some(Value::Text(a)), Some(Value::Text(b)), Some(Value::Text(c))] =
                columns.map(|column| values.get(column))
            else {
                summary.lose(rows.offset(database), 0, "a row of the table lacks a text");
                continue;
            };
            let texts = [text(a, LONGEST_TOPIC), text(b, LONGEST_TOPIC), text(c, LONGEST_DEFINITION)];
            // The column of type INTEGER PRIMARY KEY is the number of the row.
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
        let most = behind([topic, stamp, data]);
        let mut count = 0;
        while let Some(cell) = database.next(rows, &mut output.summary)? {
            database.input().tell(output.sink)?;
            let offset = rows.offset(database);
            let first = values(rows.beginning(&cell), most);
            // Rows that were lost may be those of other tables.
            let Some(Value::Integer(topic)) = first.get(topic) else {
                if !rows.are_lost() {
                    output.summary.lose(offset, 0, "a message lacks its topic");
                }
                continue;
            };
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
            let values = values(&self.content, most);
            if let (Some(&Value::Integer(received_ns)), Some(Value::Blob(data))) =
                (values.get(stamp), values.get(data))
            {
                count += 1;
                self.topics.message(topic, data, Envelope { received_ns, sent_ns: None, offset }, output);
            } else if !rows.are_lost() {
                output.summary.lose(offset, 0, "a message lacks its stamp or its data");
            }
        }
        Ok(count)
    }
}

/// Number of columns up to the last one of these.
fn behind(columns: [usize; 3]) -> usize {
    columns.into_iter().max().map_or(0, |last| last + 1)
}
