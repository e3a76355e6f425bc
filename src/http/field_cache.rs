//! The memory of what outlives a request about fields, bounded by bytes. What is put there, and how it is made, is in
//! [`fields`](super::fields).

use std::any::Any;
use std::sync::Arc;

use futures_util::future::BoxFuture;
use quick_cache::{OptionsBuilder, Weighter, sync::Cache};

use super::problem::Problem;
use super::slots::Turn;

type Entry = Arc<dyn Any + Send + Sync>;

#[derive(Debug, Clone, Copy)]
struct ByBytes;

impl Weighter<String, (Entry, u64)> for ByBytes {
    fn weight(&self, _key: &String, value: &(Entry, u64)) -> u64 {
        value.1.max(1)
    }
}

/// What outlives a request.
pub struct FieldCache {
    kept: Option<Cache<String, (Entry, u64), ByBytes>>,
    bytes: u64,
}

impl std::fmt::Debug for FieldCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FieldCache").finish_non_exhaustive()
    }
}

impl FieldCache {
    /// A cache of so many bytes. One shard: with more, each would hold its part only, and a large surface would fit in
    /// none.
    pub fn new(bytes: u64) -> Self {
        let options = OptionsBuilder::new().shards(1).estimated_items_capacity(64).weight_capacity(bytes).build();
        let made = |options| Cache::with_options(options, ByBytes, Default::default(), Default::default());
        Self { kept: options.ok().map(made), bytes }
    }

    /// The bytes that factors of one surface may take: what would be thrown out as soon as it is made is no use to a
    /// design.
    pub fn room(&self) -> u64 {
        self.bytes / 4 * 3
    }

    /// What lies at a key, or what is made now, with the bytes that it takes. One key, one type.
    pub async fn get<'a, T: Any + Send + Sync>(
        &'a self,
        turn: &'a Turn,
        key: String,
        make: impl Future<Output = Result<(T, u64), Problem>> + Send + 'a,
    ) -> Result<Arc<T>, Problem> {
        let made = Box::pin(async {
            let (value, bytes) = make.await?;
            Ok((Arc::new(value) as Entry, bytes))
        });
        let found = self.entry(turn, &key, made).await?;
        found.downcast().map_err(|_| Problem::internal(format!("the cache holds something else as {key}")))
    }

    fn entry<'a>(
        &'a self,
        turn: &'a Turn,
        key: &'a String,
        made: BoxFuture<'a, Result<(Entry, u64), Problem>>,
    ) -> BoxFuture<'a, Result<Entry, Problem>> {
        Box::pin(async move {
            match self.kept.as_ref().map(|cache| (cache, cache.get(key))) {
                Some((_, Some((found, _)))) => Ok(found),
                absent => {
                    // Whoever makes it, and whoever waits for what another one makes.
                    turn.step_aside();
                    match absent {
                        Some((cache, _)) => Ok(cache.get_or_insert_async(key, made).await?.0),
                        None => Ok(made.await?.0),
                    }
                }
            }
        })
    }
}
