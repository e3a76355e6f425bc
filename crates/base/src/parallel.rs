//! Parallel iterators: those of rayon, whose halves meet in one function.
//!
//! Rayon compiles its scheduler anew for each loop, a thousand lines for every pass over an array, which were a fifth
//! of the generated code of the libraries. Here a loop is halved by the same rule, and its halves are handed over as
//! `dyn FnMut`: a call for each piece of work, none for each element. `use chladni_base::parallel::*` stands where
//! `use rayon::prelude::*` would.

use rayon::iter::plumbing::{Consumer, Folder, Producer, ProducerCallback, Reducer, UnindexedConsumer};
use rayon::iter::{self, Enumerate, MaxLen, MinLen, Zip};
use rayon::slice;

pub use rayon::iter::{IndexedParallelIterator, ParallelExtend, ParallelIterator};

/// A loop whose length is known, as rayon makes it, that is run by `halve`.
///
/// What rayon would run itself, since it joins loops or needs positions, is wrapped once more.
#[derive(Clone, Debug)]
#[must_use = "iterators do nothing until they are used"]
pub struct Halved<I>(I);

impl<I: IndexedParallelIterator> Halved<I> {
    /// Two loops in step; the longer one is cut.
    #[inline]
    pub fn zip<J: iter::IntoParallelIterator<Iter: IndexedParallelIterator>>(
        self,
        other: J,
    ) -> Halved<Zip<I, J::Iter>> {
        Halved(self.0.zip(other))
    }

    /// With positions, from zero.
    #[inline]
    pub fn enumerate(self) -> Halved<Enumerate<I>> {
        Halved(self.0.enumerate())
    }

    /// Pieces that would be shorter than this are not halved.
    #[inline]
    pub fn with_min_len(self, least: usize) -> Halved<MinLen<I>> {
        Halved(self.0.with_min_len(least))
    }

    /// Pieces that are longer than this are halved.
    #[inline]
    pub fn with_max_len(self, most: usize) -> Halved<MaxLen<I>> {
        Halved(self.0.with_max_len(most))
    }
}

impl<I: IndexedParallelIterator> ParallelIterator for Halved<I> {
    type Item = I::Item;

    #[inline]
    fn drive_unindexed<C: UnindexedConsumer<I::Item>>(self, consumer: C) -> C::Result {
        self.drive(consumer)
    }

    #[inline]
    fn opt_len(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

impl<I: IndexedParallelIterator> IndexedParallelIterator for Halved<I> {
    #[inline]
    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn drive<C: Consumer<I::Item>>(self, consumer: C) -> C::Result {
        let length = self.0.len();
        self.0.with_producer(TakeAll { length, consumer })
    }

    #[inline]
    fn with_producer<C: ProducerCallback<I::Item>>(self, callback: C) -> C::Output {
        self.0.with_producer(callback)
    }
}

struct TakeAll<C> {
    length: usize,
    consumer: C,
}

impl<T, C: Consumer<T>> ProducerCallback<T> for TakeAll<C> {
    type Output = C::Result;

    #[inline]
    fn callback<P: Producer<Item = T>>(self, producer: P) -> C::Result {
        let Self { length, consumer } = self;
        let splits = rayon::current_num_threads().max(length / producer.max_len().max(1));
        let splitter = Splitter { splits, least: producer.min_len().max(1) };
        halve(length, false, splitter, producer, consumer)
    }
}

/// How often a piece of work is halved: until every thread has one, and anew when another thread has taken it. Rayon's
/// own rule.
#[derive(Clone, Copy)]
struct Splitter {
    splits: usize,
    least: usize,
}

impl Splitter {
    fn splits(&mut self, length: usize, taken: bool) -> bool {
        if length / 2 < self.least || self.splits == 0 && !taken {
            return false;
        }
        self.splits /= 2;
        if taken {
            self.splits = self.splits.max(rayon::current_num_threads());
        }
        true
    }
}

/// A half: what there is to do, and then what came of it.
enum Half<P, C, R> {
    Open(P, C),
    Done(R),
    Running,
}

impl<P: Producer, C: Consumer<P::Item>> Half<P, C, C::Result> {
    fn run(&mut self, length: usize, taken: bool, splitter: Splitter) {
        if let Self::Open(producer, consumer) = std::mem::replace(self, Self::Running) {
            *self = Self::Done(halve(length, taken, splitter, producer, consumer));
        }
    }
}

fn halve<P: Producer, C: Consumer<P::Item>>(
    length: usize,
    taken: bool,
    mut splitter: Splitter,
    producer: P,
    consumer: C,
) -> C::Result {
    if consumer.full() {
        return consumer.into_folder().complete();
    }
    if !splitter.splits(length, taken) {
        return producer.fold_with(consumer.into_folder()).complete();
    }
    let middle = length / 2;
    let (low, high) = producer.split_at(middle);
    let (low_consumer, high_consumer, reducer) = consumer.split_at(middle);
    let (mut low, mut high) = (Half::Open(low, low_consumer), Half::Open(high, high_consumer));
    join(&mut |taken| low.run(middle, taken, splitter), &mut |taken| high.run(length - middle, taken, splitter));
    match (low, high) {
        (Half::Done(low), Half::Done(high)) => reducer.reduce(low, high),
        _ => unreachable!("both halves have run"),
    }
}

/// Runs both, on two threads where one is free. Each is told whether another thread has taken it.
fn join(low: &mut (dyn FnMut(bool) + Send), high: &mut (dyn FnMut(bool) + Send)) {
    rayon::join_context(|context| low(context.migrated()), |context| high(context.migrated()));
}

/// What is iterated over in parallel by value: ranges and vectors.
pub trait IntoHalved: Sized + iter::IntoParallelIterator<Iter: IndexedParallelIterator> {
    #[inline]
    fn into_par_iter(self) -> Halved<Self::Iter> {
        Halved(iter::IntoParallelIterator::into_par_iter(self))
    }
}

impl<T: iter::IntoParallelIterator<Iter: IndexedParallelIterator>> IntoHalved for T {}

/// What is iterated over in parallel by reference.
pub trait IterHalved<'a> {
    /// What rayon makes of it.
    type Iter: IndexedParallelIterator;

    fn par_iter(&'a self) -> Halved<Self::Iter>;
}

impl<'a, T: ?Sized + 'a> IterHalved<'a> for T
where
    &'a T: iter::IntoParallelIterator<Iter: IndexedParallelIterator>,
{
    type Iter = <&'a T as iter::IntoParallelIterator>::Iter;

    #[inline]
    fn par_iter(&'a self) -> Halved<Self::Iter> {
        Halved(iter::IntoParallelIterator::into_par_iter(self))
    }
}

/// What is changed in parallel.
pub trait IterMutHalved<'a> {
    /// What rayon makes of it.
    type Iter: IndexedParallelIterator;

    fn par_iter_mut(&'a mut self) -> Halved<Self::Iter>;
}

impl<'a, T: ?Sized + 'a> IterMutHalved<'a> for T
where
    &'a mut T: iter::IntoParallelIterator<Iter: IndexedParallelIterator>,
{
    type Iter = <&'a mut T as iter::IntoParallelIterator>::Iter;

    #[inline]
    fn par_iter_mut(&'a mut self) -> Halved<Self::Iter> {
        Halved(iter::IntoParallelIterator::into_par_iter(self))
    }
}

/// Slices in chunks, and sorted.
pub trait HalvedSlice<T> {
    /// Chunks of `size`; the last one may be shorter.
    fn par_chunks(&self, size: usize) -> Halved<slice::Chunks<'_, T>>
    where
        T: Sync;

    /// Chunks of `size` without a shorter rest.
    fn par_chunks_exact(&self, size: usize) -> Halved<slice::ChunksExact<'_, T>>
    where
        T: Sync;

    /// [`Self::par_chunks`], to be changed.
    fn par_chunks_mut(&mut self, size: usize) -> Halved<slice::ChunksMut<'_, T>>
    where
        T: Send;

    /// [`Self::par_chunks_exact`], to be changed.
    fn par_chunks_exact_mut(&mut self, size: usize) -> Halved<slice::ChunksExactMut<'_, T>>
    where
        T: Send;

    /// In ascending order.
    fn par_sort_unstable(&mut self)
    where
        T: Ord + Send;

    /// In the order that `compare` says.
    fn par_sort_unstable_by(&mut self, compare: impl Fn(&T, &T) -> std::cmp::Ordering + Sync)
    where
        T: Send;

    /// In ascending order of their keys; equals keep theirs.
    fn par_sort_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K + Sync)
    where
        T: Send;
}

impl<T> HalvedSlice<T> for [T] {
    #[inline]
    fn par_chunks(&self, size: usize) -> Halved<slice::Chunks<'_, T>>
    where
        T: Sync,
    {
        Halved(slice::ParallelSlice::par_chunks(self, size))
    }

    #[inline]
    fn par_chunks_exact(&self, size: usize) -> Halved<slice::ChunksExact<'_, T>>
    where
        T: Sync,
    {
        Halved(slice::ParallelSlice::par_chunks_exact(self, size))
    }

    #[inline]
    fn par_chunks_mut(&mut self, size: usize) -> Halved<slice::ChunksMut<'_, T>>
    where
        T: Send,
    {
        Halved(slice::ParallelSliceMut::par_chunks_mut(self, size))
    }

    #[inline]
    fn par_chunks_exact_mut(&mut self, size: usize) -> Halved<slice::ChunksExactMut<'_, T>>
    where
        T: Send,
    {
        Halved(slice::ParallelSliceMut::par_chunks_exact_mut(self, size))
    }

    #[inline]
    fn par_sort_unstable(&mut self)
    where
        T: Ord + Send,
    {
        slice::ParallelSliceMut::par_sort_unstable(self);
    }

    #[inline]
    fn par_sort_unstable_by(&mut self, compare: impl Fn(&T, &T) -> std::cmp::Ordering + Sync)
    where
        T: Send,
    {
        slice::ParallelSliceMut::par_sort_unstable_by(self, compare);
    }

    #[inline]
    fn par_sort_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K + Sync)
    where
        T: Send,
    {
        slice::ParallelSliceMut::par_sort_by_key(self, key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On pools of several sizes.
    fn on_threads(check: impl Fn() + Sync) {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(&check);
        }
    }

    #[test]
    fn every_element_is_met_once_and_what_comes_of_it_stays_in_order() {
        on_threads(|| {
            for length in [0, 1, 2, 3, 1000] {
                let squares: Vec<usize> = (0..length).into_par_iter().map(|i| i * i).collect();
                assert!(squares.iter().enumerate().all(|(i, &square)| square == i * i) && squares.len() == length);
                let even: Vec<usize> = squares.par_iter().copied().filter(|x| x % 2 == 0).collect();
                assert_eq!(even, squares.iter().copied().filter(|x| x % 2 == 0).collect::<Vec<_>>());
                let mut counts = vec![0; length];
                counts.par_iter_mut().enumerate().with_min_len(7).for_each(|(i, count)| *count += i);
                counts.par_chunks_mut(3).zip(squares.par_chunks(3)).with_max_len(2).for_each(|(counts, squares)| {
                    counts.iter_mut().zip(squares).for_each(|(count, square)| *count = square - *count);
                });
                assert!(counts.iter().enumerate().all(|(i, &count)| count == i * i - i));
            }
        });
    }

    #[test]
    fn the_first_error_ends_it_and_a_panic_goes_through() {
        on_threads(|| {
            let met = (0..1000).into_par_iter().map(|i| if i == 500 { Err(i) } else { Ok(i) });
            assert_eq!(met.collect::<Result<Vec<usize>, usize>>(), Err(500));
            let thrown =
                std::panic::catch_unwind(|| (0..100).into_par_iter().for_each(|i| assert!(i != 70, "seventy")));
            assert!(thrown.is_err());
        });
    }

    #[test]
    fn pieces_are_no_shorter_than_asked_for() {
        on_threads(|| {
            let lengths = (0..1000).into_par_iter().with_min_len(100).fold(|| 0, |length, _| length + 1);
            assert!(lengths.collect::<Vec<usize>>().into_iter().all(|length| length >= 100));
        });
    }
}
