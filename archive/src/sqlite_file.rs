//! rosbag2's SQLite storage (`.db3`): one table of topics, one of messages.

use std::path::{Path, PathBuf};

use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags};

use crate::cursor::{Cursor, RawMessage};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::topic::Topic;

/// First bytes of a SQLite database.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";
/// Approximate size of the messages read at once \[bytes\]; at least one message is read.
/// Resolution: memory against the number of reads.
const PAGE_BYTES: usize = 4 << 20;

/// A database whose topics and messages have been counted.
#[derive(Debug)]
pub(crate) struct SqliteFile {
    path: PathBuf,
    /// Each topic with its number in the database.
    pub(crate) topics: Vec<(i64, Topic)>,
    pub(crate) log_times_ns: Option<(i64, i64)>,
    pub(crate) damage: Vec<Damage>,
}

impl SqliteFile {
    pub(crate) fn read(path: &Path) -> Result<Self, ArchiveError> {
        let mut file = Self {
            path: path.to_owned(),
            topics: Vec::new(),
            log_times_ns: None,
            damage: Vec::new(),
        };
        let connection = connect(path, false)?;
        are_tables(&connection, path)?;
        let Err(error) = file.look_through(&connection) else {
            return Ok(file);
        };
        file.look_as_far_as_it_goes(&connect(path, true)?, &error)
            .map_err(|error| ArchiveError::Unreadable {
                path: path.to_owned(),
                reason: error.to_string(),
            })?;
        Ok(file)
    }

    fn look_through(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        self.topics = topics(connection)?;
        self.count(connection)
    }

    fn count(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let mut statement = connection.prepare(
            "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages \
             GROUP BY topic_id",
        )?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let count = u64::try_from(row.get::<_, i64>(1)?).unwrap_or(0);
            self.note(row.get(0)?, count, row.get(2)?, row.get(3)?);
        }
        Ok(())
    }

    /// Counts row by row as far as the database can be read.
    fn look_as_far_as_it_goes(
        &mut self,
        connection: &Connection,
        error: &rusqlite::Error,
    ) -> rusqlite::Result<()> {
        self.topics = topics(connection)?;
        self.log_times_ns = None;
        let mut statement =
            connection.prepare("SELECT id, topic_id, timestamp FROM messages ORDER BY id")?;
        let mut rows = statement.query([])?;
        let mut last_id = 0;
        while let Ok(Some(row)) = rows.next() {
            last_id = row.get(0)?;
            self.note(row.get(1)?, 1, row.get(2)?, row.get(2)?);
        }
        self.damage.push(Damage {
            path: self.path.clone(),
            at: u64::try_from(last_id).unwrap_or(0),
            kind: DamageKind::Database {
                reason: error.to_string(),
            },
            readable_until_ns: self.log_times_ns.map(|(_, end_ns)| end_ns),
        });
        Ok(())
    }

    fn note(&mut self, topic_id: i64, count: u64, first_ns: i64, last_ns: i64) {
        if let Some((_, topic)) = self.topics.iter_mut().find(|(id, _)| *id == topic_id) {
            topic.message_count += count;
        }
        let (start_ns, end_ns) = self.log_times_ns.unwrap_or((first_ns, last_ns));
        self.log_times_ns = Some((start_ns.min(first_ns), end_ns.max(last_ns)));
    }

    /// Creates a cursor over the topics for which `topic` returns a number, by their number in the database.
    pub(crate) fn cursor(
        &self,
        topic: impl Fn(i64) -> Option<usize>,
    ) -> Result<SqliteCursor, ArchiveError> {
        let topics = self.topics.iter();
        let topics: Vec<_> = topics
            .filter_map(|&(id, _)| Some((id, topic(id)?)))
            .collect();
        let connection = connect(&self.path, !self.damage.is_empty())?;
        let order = Order::of(&connection, !self.damage.is_empty(), &topics).map_err(|source| {
            ArchiveError::Sqlite {
                path: self.path.clone(),
                source,
            }
        })?;
        Ok(SqliteCursor {
            path: self.path.clone(),
            query: order.query(&topics),
            connection,
            topics,
            after: (i64::MIN, i64::MIN),
            page: Vec::new(),
            bytes: Vec::new(),
            current: None,
            ended: false,
            damage_is_known: !self.damage.is_empty(),
        })
    }
}

fn connect(path: &Path, torn: bool) -> Result<Connection, ArchiveError> {
    let open = || {
        let connection = Connection::open_with_flags(
            path,
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX,
        )?;
        // A view or a trigger of an untrusted file may run forever, or call unsafe functions.
        connection.pragma_update(None, "trusted_schema", false)?;
        if torn {
            // Without it, SQLite refuses a file that is shorter than its header says.
            connection.pragma_update(None, "writable_schema", true)?;
        }
        Ok(connection)
    };
    open().map_err(|source| ArchiveError::Sqlite {
        path: path.to_owned(),
        source,
    })
}

/// Rejects anything but plain tables. rosbag2 writes nothing else, and a view may run forever.
fn are_tables(connection: &Connection, path: &Path) -> Result<(), ArchiveError> {
    let kind = |name: &str| {
        connection.query_row(
            "SELECT type || CASE WHEN sql LIKE 'CREATE VIRTUAL%' THEN ' (virtual)' ELSE '' END \
             FROM sqlite_master WHERE name = ?1",
            [name],
            |row| row.get::<_, String>(0),
        )
    };
    for name in ["topics", "messages"] {
        // A missing or unreadable table is reported when it is read.
        match kind(name) {
            Ok(kind) if kind != "table" => {
                return Err(ArchiveError::Unreadable {
                    path: path.to_owned(),
                    reason: format!("`{name}` is a {kind}, where rosbag2 has a table"),
                });
            }
            _ => {}
        }
    }
    Ok(())
}

fn topics(connection: &Connection) -> rusqlite::Result<Vec<(i64, Topic)>> {
    let mut statement = connection.prepare("SELECT * FROM topics ORDER BY id")?;
    // Bags of older ROS distributions have no hash.
    let hash = statement.column_index("type_description_hash").ok();
    let topic = |row: &rusqlite::Row<'_>| {
        let hash: Option<String> = match hash {
            Some(column) => row.get(column)?,
            None => None,
        };
        let topic = Topic {
            name: row.get("name")?,
            type_name: row.get("type")?,
            message_encoding: row.get("serialization_format")?,
            type_hash: hash.filter(|hash| !hash.is_empty()),
            offered_qos: None,
            message_count: 0,
        };
        Ok((row.get("id")?, topic))
    };
    statement.query_map([], topic)?.collect()
}

/// Order in which rows are read.
enum Order {
    /// By time, through the table's index.
    Index,
    /// By time, through a temporary table: bags of the first ROS 2 distributions have no index.
    TemporaryTable,
    /// In the order of writing, the only one for a damaged database.
    Row,
}

impl Order {
    fn of(
        connection: &Connection,
        damaged: bool,
        topics: &[(i64, usize)],
    ) -> rusqlite::Result<Self> {
        if damaged {
            return Ok(Self::Row);
        }
        let indexed: bool = connection.query_row(
            "SELECT EXISTS (SELECT 1 FROM pragma_index_list('messages') AS list, \
             pragma_index_info(list.name) AS info WHERE info.seqno = 0 AND info.name = 'timestamp')",
            [],
            |row| row.get(0),
        )?;
        if indexed {
            return Ok(Self::Index);
        }
        connection.execute_batch(&format!(
            "CREATE TEMP TABLE in_order AS SELECT id FROM messages WHERE {} ORDER BY timestamp, id",
            in_topics(topics)
        ))?;
        Ok(Self::TemporaryTable)
    }

    /// Returns the query for key, topic, time and data of the rows after the time `?1` and the key `?2`.
    fn query(&self, topics: &[(i64, usize)]) -> String {
        let wanted = in_topics(topics);
        match self {
            Self::Index => format!(
                "SELECT id, topic_id, timestamp, data FROM messages WHERE {wanted} AND \
                 (timestamp, id) > (?1, ?2) ORDER BY timestamp, id"
            ),
            Self::TemporaryTable => "SELECT in_order.rowid, topic_id, timestamp, data \
                 FROM in_order JOIN messages ON messages.id = in_order.id \
                 WHERE ?1 IS NOT NULL AND in_order.rowid > ?2 ORDER BY in_order.rowid"
                .to_owned(),
            Self::Row => format!(
                "SELECT id, topic_id, timestamp, data FROM messages WHERE {wanted} AND \
                 ?1 IS NOT NULL AND id > ?2 ORDER BY id"
            ),
        }
    }
}

fn in_topics(topics: &[(i64, usize)]) -> String {
    let ids: Vec<_> = topics.iter().map(|(id, _)| id.to_string()).collect();
    format!("topic_id IN ({})", ids.join(", "))
}

pub(crate) struct SqliteCursor {
    path: PathBuf,
    connection: Connection,
    query: String,
    topics: Vec<(i64, usize)>,
    /// Time and key of the last row that was read.
    after: (i64, i64),
    /// Rows read and not returned yet, the next one last.
    page: Vec<PageRow>,
    bytes: Vec<u8>,
    current: Option<PageRow>,
    ended: bool,
    /// Whether the damage was reported when the database was opened, so that it is not reported again.
    damage_is_known: bool,
}

struct PageRow {
    key: i64,
    topic: usize,
    time_ns: i64,
    data: std::ops::Range<usize>,
}

impl SqliteCursor {
    fn read_page(&mut self) -> rusqlite::Result<()> {
        self.bytes.clear();
        let mut statement = self.connection.prepare(&self.query)?;
        let mut rows = statement.query(<[i64; 2]>::from(self.after))?;
        while let Some(row) = rows.next()? {
            let (key, topic_id, time_ns): (i64, i64, i64) = (row.get(0)?, row.get(1)?, row.get(2)?);
            let data = match row.get_ref(3)? {
                ValueRef::Blob(data) | ValueRef::Text(data) => data,
                _ => &[],
            };
            let from = self.bytes.len();
            self.bytes.extend_from_slice(data);
            self.after = (time_ns, key);
            let topic = self.topics.iter().find(|(id, _)| *id == topic_id);
            if let Some(&(_, topic)) = topic {
                self.page.push(PageRow {
                    key,
                    topic,
                    time_ns,
                    data: from..self.bytes.len(),
                });
            }
            if self.bytes.len() >= PAGE_BYTES {
                break;
            }
        }
        self.page.reverse();
        Ok(())
    }

    fn damaged(&self, row: u64, kind: DamageKind) -> ArchiveError {
        ArchiveError::Damaged(Damage {
            path: self.path.clone(),
            at: row,
            kind,
            readable_until_ns: Some(self.after.0).filter(|&ns| ns >= 0),
        })
    }
}

impl Cursor for SqliteCursor {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        self.current = None;
        if self.page.is_empty() && !self.ended {
            if let Err(error) = self.read_page() {
                // The rows of this page before the error are still returned.
                self.page.reverse();
                self.ended = true;
                if !self.damage_is_known {
                    let row = u64::try_from(self.after.1).unwrap_or(0);
                    let reason = error.to_string();
                    return Err(self.damaged(row, DamageKind::Database { reason }));
                }
            }
            self.ended |= self.page.is_empty();
        }
        let Some(row) = self.page.pop() else {
            return Ok(false);
        };
        let at = u64::try_from(row.key).unwrap_or(0);
        if row.time_ns < 0 {
            let reason = format!("message at {} ns, before the epoch", row.time_ns);
            return Err(self.damaged(at, DamageKind::Record { reason }));
        }
        self.current = Some(row);
        Ok(true)
    }

    fn current(&self) -> Option<RawMessage<'_>> {
        self.current.as_ref().map(|row| RawMessage {
            topic: row.topic,
            log_time_ns: row.time_ns,
            publish_time_ns: row.time_ns,
            sequence: 0,
            at: u64::try_from(row.key).unwrap_or(0),
            body: &self.bytes[row.data.clone()],
        })
    }
}
