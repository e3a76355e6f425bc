//! Keyset pages: newest first, stable while new rows arrive.

use super::{
    StoreError,
    catalog::Catalog,
    sql::{QueryBuilder, Row},
};

/// Which page of a list is wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageRequest {
    /// The most items; at least 1 and at most [`PageRequest::MOST`] are given whatever is asked.
    pub limit: u32,
    /// [`Page::next`] of the page before; the newest items without one.
    pub from: Option<String>,
}

impl PageRequest {
    /// The most items of one page.
    pub const MOST: u32 = 200;

    /// The limit as a bound of a query that looks one item ahead.
    pub(super) fn look_ahead(&self) -> i64 {
        i64::from(self.limit.clamp(1, Self::MOST)) + 1
    }

    /// The sequence number that every item of the page stays below.
    pub(super) fn below(&self) -> Result<i64, StoreError> {
        let Some(cursor) = &self.from else { return Ok(i64::MAX) };
        cursor
            .parse::<i64>()
            .ok()
            .filter(|&sequence| sequence > 0)
            .ok_or_else(|| StoreError::InvalidCursor { cursor: cursor.chars().take(40).collect() })
    }
}

impl Default for PageRequest {
    fn default() -> Self {
        Self { limit: 50, from: None }
    }
}

/// A list that is asked for, newest first: what is selected, by what it is filtered, and which page of it.
pub(super) struct Listing<'a> {
    catalog: &'a Catalog,
    page: &'a PageRequest,
    query: QueryBuilder,
}

impl<'a> Listing<'a> {
    /// What a statement selects that ends in `sequence < `.
    pub fn new(catalog: &'a Catalog, below: &'static str, page: &'a PageRequest) -> Result<Self, StoreError> {
        let mut query = QueryBuilder::new(below);
        query.push_bind(page.below()?);
        Ok(Self { catalog, page, query })
    }

    /// Only rows whose column has a value, where there is one to filter by.
    pub fn with(mut self, column: &'static str, value: Option<&str>) -> Self {
        if let Some(value) = value {
            self.query.push(" AND ").push(column).push(" = ").push_bind(value);
        }
        self
    }

    /// Only rows whose column has another value, where there is one to leave out.
    pub fn without(mut self, column: &'static str, value: Option<&str>) -> Self {
        if let Some(value) = value {
            self.query.push(" AND ").push(column).push(" <> ").push_bind(value);
        }
        self
    }

    /// Only rows whose column is among what a selection gives that ends in a column with this value, where there is one
    /// to filter by.
    pub fn among(mut self, column: &'static str, selection: &'static str, value: Option<&str>) -> Self {
        if let Some(value) = value {
            self.query.push(" AND ").push(column).push(" IN (").push(selection).push(" = ").push_bind(value).push(")");
        }
        self
    }

    /// Only rows whose name contains a text, where there is one. Letters of ASCII are alike in both cases.
    pub fn named(mut self, part: Option<&str>) -> Self {
        if let Some(part) = part {
            let [before, after] = self.catalog.contains("name");
            self.query.push(" AND ").push(&before).push_bind(part).push(&after);
        }
        self
    }

    /// The page, its rows read one by one.
    pub async fn read<T>(mut self, read: impl Fn(&Row) -> Result<T, StoreError>) -> Result<Page<T>, StoreError> {
        self.query.push(" ORDER BY sequence DESC LIMIT ").push_bind(self.page.look_ahead());
        let rows = self.query.build().fetch_all(self.catalog.reader()).await?;
        let rows = rows.iter().map(|row| Ok((row.try_get("sequence")?, read(row)?)));
        Ok(Page::from_rows(rows.collect::<Result<_, StoreError>>()?, self.page))
    }
}

/// One page of a list, newest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// The cursor of the next page; `None` on the last.
    pub next: Option<String>,
}

impl<T> Page<T> {
    /// A page from rows that look one item ahead, each with its sequence number.
    pub(super) fn from_rows(mut rows: Vec<(i64, T)>, request: &PageRequest) -> Self {
        let most = (request.look_ahead() - 1) as usize;
        let more = rows.len() > most;
        rows.truncate(most);
        let next = rows.last().filter(|_| more).map(|(sequence, _)| sequence.to_string());
        Self { items: rows.into_iter().map(|(_, item)| item).collect(), next }
    }
}
