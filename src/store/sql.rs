//! Statements for whichever database keeps the records: one text for both, with `?` or `?1` where values go, and rows
//! that are read alike.
//!
//! Not `sqlx::Any`, which writes one placeholder for both and knows neither `BEGIN IMMEDIATE` nor `LISTEN`:
//! docs/decisions/0072.

use std::marker::PhantomData;

use futures_util::future::BoxFuture;
use sqlx::{AssertSqlSafe, ColumnIndex, SqlSafeStr, SqlStr, SqliteConnection, SqlitePool, sqlite::SqliteRow};
#[cfg(feature = "cluster")]
use sqlx::{PgConnection, postgres::PgRow};

#[cfg(feature = "cluster")]
use super::{connections::Connections, fullness::Fullness};

/// Where a statement runs.
pub(super) enum On<'c> {
    /// Within a transaction of SQLite.
    Sqlite(&'c mut SqliteConnection),
    /// On any connection of SQLite that reads.
    SqliteReader(&'c SqlitePool),
    /// Within a transaction of PostgreSQL.
    #[cfg(feature = "cluster")]
    Postgres(&'c mut PgConnection, Pooler, &'c Fullness),
    /// On any connection of PostgreSQL, in a transaction of its own.
    #[cfg(feature = "cluster")]
    PostgresPool(&'c Connections, Pooler),
}

/// What stands between a process and PostgreSQL.
#[cfg(feature = "cluster")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pooler {
    /// Nothing, or what gives each client a connection of its own: statements are prepared once.
    Absent,
    /// What gives connections out for one transaction: no statement outlives one, and each is sent within one, since it
    /// is prepared and run in two steps.
    ByTransaction,
}

/// A row of an answer.
pub(super) enum Row {
    Sqlite(SqliteRow),
    #[cfg(feature = "cluster")]
    Postgres(PgRow),
}

/// A value that goes into a statement; absent ones have a type as well.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Integer(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

macro_rules! values {
    ($($from:ty => $variant:ident: $convert:expr;)*) => {$(
        impl From<$from> for Value {
            fn from(value: $from) -> Self {
                Self::$variant(Some(($convert)(value)))
            }
        }
        impl From<Option<$from>> for Value {
            fn from(value: Option<$from>) -> Self {
                Self::$variant(value.map($convert))
            }
        }
    )*};
}

values! {
    i64 => Integer: |value| value;
    i32 => Integer: i64::from;
    f64 => Real: |value| value;
    String => Text: |value| value;
    &str => Text: str::to_owned;
    &String => Text: String::clone;
    Vec<u8> => Bytes: |value| value;
}

impl From<&Option<String>> for Value {
    fn from(value: &Option<String>) -> Self {
        Self::Text(value.clone())
    }
}

/// A statement and its values.
pub(super) struct Query {
    text: SqlStr,
    values: Vec<Value>,
}

/// A statement.
pub(super) fn query(text: impl SqlSafeStr) -> Query {
    Query { text: text.into_sql_str(), values: Vec::new() }
}

/// A statement of whose rows the first column is wanted.
pub(super) fn query_scalar<T>(text: impl SqlSafeStr) -> Scalar<T> {
    Scalar { query: query(text), column: PhantomData }
}

/// Binds the values and runs the statement by the method of that name.
macro_rules! run {
    ($text:expr, $values:expr, $method:ident, $on:expr) => {
        run!($text, $values, $method, $on, true)
    };
    ($text:expr, $values:expr, $method:ident, $on:expr, $prepared:expr) => {{
        let mut query = sqlx::query($text).persistent($prepared);
        for value in $values {
            query = match value {
                Value::Integer(value) => query.bind(value),
                Value::Real(value) => query.bind(value),
                Value::Text(value) => query.bind(value),
                Value::Bytes(value) => query.bind(value),
            };
        }
        query.$method($on).await
    }};
}

/// Runs the statement on whichever database there is, and turns what comes by `$into`.
macro_rules! dispatch {
    ($query:expr, $method:ident, $on:expr, $sqlite:expr, $postgres:expr) => {{
        let Query { text, values } = $query;
        match $on {
            On::Sqlite(on) => run!(text, values, $method, on).map($sqlite),
            On::SqliteReader(on) => run!(text, values, $method, on).map($sqlite),
            #[cfg(feature = "cluster")]
            On::Postgres(on, pooler, fullness) => {
                let text = AssertSqlSafe(numbered(text.as_str()));
                let answer = run!(text, values, $method, on, pooler == Pooler::Absent);
                answer.inspect_err(|error| fullness.note(error)).map($postgres)
            }
            #[cfg(feature = "cluster")]
            On::PostgresPool(on, Pooler::Absent) => {
                let text = AssertSqlSafe(numbered(text.as_str()));
                // In a place of its own: whoever waits for a statement would be as large as all that it may do.
                let answer = Box::pin(on.run(async |connection| run!(text, values, $method, connection))).await;
                answer.inspect_err(|error| on.fullness().note(error)).map($postgres)
            }
            #[cfg(feature = "cluster")]
            On::PostgresPool(on, Pooler::ByTransaction) => {
                Box::pin(async move {
                    let mut transaction = on.begin_asked().await?;
                    let text = AssertSqlSafe(numbered(text.as_str()));
                    let answer = run!(text, values, $method, &mut *transaction, false);
                    let answer = answer.inspect_err(|error| on.fullness().note(error))?;
                    transaction.commit().await?;
                    Ok(answer).map($postgres)
                })
                .await
            }
        }
    }};
}

impl Query {
    /// Gives the next value.
    pub fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// The first row, if there is one. Boxed, as is what else many places await: docs/decisions/0025.
    pub fn fetch_optional(self, on: On<'_>) -> BoxFuture<'_, Result<Option<Row>, sqlx::Error>> {
        Box::pin(async move {
            dispatch!(self, fetch_optional, on, |row| row.map(Row::Sqlite), |row| row.map(Row::Postgres))
        })
    }

    /// The only row.
    pub async fn fetch_one(self, on: On<'_>) -> Result<Row, sqlx::Error> {
        self.fetch_optional(on).await?.ok_or(sqlx::Error::RowNotFound)
    }

    /// Every row.
    pub fn fetch_all(self, on: On<'_>) -> BoxFuture<'_, Result<Vec<Row>, sqlx::Error>> {
        Box::pin(async move {
            dispatch!(self, fetch_all, on, |rows| rows.into_iter().map(Row::Sqlite).collect(), |rows| rows
                .into_iter()
                .map(Row::Postgres)
                .collect())
        })
    }

    /// Runs it for what it changes, and gives how many rows those were.
    pub fn execute(self, on: On<'_>) -> BoxFuture<'_, Result<u64, sqlx::Error>> {
        Box::pin(async move { dispatch!(self, execute, on, |done| done.rows_affected(), |done| done.rows_affected()) })
    }
}

/// A statement of whose rows the first column is wanted.
pub(super) struct Scalar<T> {
    query: Query,
    column: PhantomData<T>,
}

impl<T> Scalar<T>
where
    T: for<'r> Column<'r>,
{
    /// Gives the next value.
    pub fn bind(mut self, value: impl Into<Value>) -> Self {
        self.query = self.query.bind(value);
        self
    }

    /// The column of the first row, if there is one.
    pub async fn fetch_optional(self, on: On<'_>) -> Result<Option<T>, sqlx::Error> {
        self.query.fetch_optional(on).await?.map(|row| row.try_get(0)).transpose()
    }

    /// The column of the only row.
    pub async fn fetch_one(self, on: On<'_>) -> Result<T, sqlx::Error> {
        self.query.fetch_one(on).await?.try_get(0)
    }

    /// The column of every row.
    pub async fn fetch_all(self, on: On<'_>) -> Result<Vec<T>, sqlx::Error> {
        self.query.fetch_all(on).await?.iter().map(|row| row.try_get(0)).collect()
    }
}

/// A statement that is put together; its values are always bound.
pub(super) struct QueryBuilder {
    text: String,
    values: Vec<Value>,
}

impl QueryBuilder {
    pub fn new(text: &str) -> Self {
        Self { text: text.to_owned(), values: Vec::new() }
    }

    /// Adds text, which may hold nothing that came from outside.
    pub fn push(&mut self, text: &str) -> &mut Self {
        self.text.push_str(text);
        self
    }

    /// Adds a value.
    pub fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.text.push('?');
        self.values.push(value.into());
        self
    }

    pub fn build(self) -> Query {
        Query { text: AssertSqlSafe(self.text).into_sql_str(), values: self.values }
    }
}

/// What a column is found by, in a row of either database.
#[cfg(feature = "cluster")]
pub(super) trait ColumnKey: ColumnIndex<SqliteRow> + ColumnIndex<PgRow> {}
#[cfg(feature = "cluster")]
impl<I: ColumnIndex<SqliteRow> + ColumnIndex<PgRow>> ColumnKey for I {}
/// What a column is found by.
#[cfg(not(feature = "cluster"))]
pub(super) trait ColumnKey: ColumnIndex<SqliteRow> {}
#[cfg(not(feature = "cluster"))]
impl<I: ColumnIndex<SqliteRow>> ColumnKey for I {}

impl Row {
    /// A column, by its name or its place.
    pub fn try_get<'r, T: Column<'r>, I: ColumnKey>(&'r self, column: I) -> Result<T, sqlx::Error> {
        T::of(self, column)
    }
}

/// What a column can be read as.
pub(super) trait Column<'r>: Sized {
    fn of(row: &'r Row, column: impl ColumnKey) -> Result<Self, sqlx::Error>;
}

macro_rules! columns {
    ($($type:ty),*) => {$(
        impl<'r> Column<'r> for $type {
            fn of(row: &'r Row, column: impl ColumnKey) -> Result<Self, sqlx::Error> {
                match row {
                    Row::Sqlite(row) => sqlx::Row::try_get(row, column),
                    #[cfg(feature = "cluster")]
                    Row::Postgres(row) => sqlx::Row::try_get(row, column),
                }
            }
        }
    )*};
}

columns!(i64, Option<i64>, f64, Option<f64>, String, Option<String>, &'r str, Option<&'r str>, Vec<u8>, &'r [u8]);

impl<'r> Column<'r> for i32 {
    fn of(row: &'r Row, column: impl ColumnKey) -> Result<Self, sqlx::Error> {
        i32::try_from(i64::of(row, column)?).map_err(|error| sqlx::Error::Decode(error.into()))
    }
}

/// Both databases keep 0 and 1, so that the texts of the statements are the same.
impl<'r> Column<'r> for bool {
    fn of(row: &'r Row, column: impl ColumnKey) -> Result<Self, sqlx::Error> {
        Ok(i64::of(row, column)? != 0)
    }
}

/// The text with `$1` where SQLite has `?1`, and with `$1`, `$2` and so on where it has `?`.
#[cfg(feature = "cluster")]
fn numbered(text: &str) -> String {
    let mut numbered = String::with_capacity(text.len() + 16);
    let mut next = 1;
    let mut rest = text;
    while let Some(place) = rest.find('?') {
        numbered.push_str(&rest[..place]);
        numbered.push('$');
        rest = &rest[place + 1..];
        if !rest.starts_with(|c: char| c.is_ascii_digit()) {
            numbered.push_str(&next.to_string());
            next += 1;
        }
    }
    numbered.push_str(rest);
    numbered
}

#[cfg(all(test, feature = "cluster"))]
mod tests {
    use super::numbered;

    #[test]
    fn places_are_numbered_in_order_or_keep_their_numbers() {
        assert_eq!(numbered("SELECT 1"), "SELECT 1");
        assert_eq!(numbered("a = ? AND b IN (?, ?)"), "a = $1 AND b IN ($2, $3)");
        assert_eq!(numbered("a = ?2 OR b = ?10 OR c = ?2"), "a = $2 OR b = $10 OR c = $2");
    }
}
