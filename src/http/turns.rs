//! Whose turn it is: clients take turns, however much one of them has waiting. In one line for all, whoever sends much
//! would have everybody else wait behind it.
//!
//! Turns are those of start-time fair queueing (Goyal, Vin and Cheng 1997), each piece of work counted as one: a client
//! that comes, and has had no more than others lately, is next.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Clients that are remembered while they have nothing waiting; beyond, all are forgotten, and count as if they came
/// for the first time.
const MOST_REMEMBERED: usize = 10_000;

/// What waits, client by client, each in the order in which it came.
#[derive(Debug)]
pub struct Lines<T> {
    /// The clients that have something waiting, each of them once, by the round that it is due in and by who came
    /// first.
    due: BTreeMap<(u64, u64), Arc<str>>,
    waiting: HashMap<Arc<str>, VecDeque<T>>,
    /// The rounds in which clients that have nothing waiting are due again, where those have not come yet.
    ahead: HashMap<Arc<str>, u64>,
    /// The round of what was given last.
    round: u64,
    come: u64,
}

impl<T> Default for Lines<T> {
    fn default() -> Self {
        Self { due: BTreeMap::new(), waiting: HashMap::new(), ahead: HashMap::new(), round: 0, come: 0 }
    }
}

impl<T> Lines<T> {
    /// Has something wait for the client's turn, behind what the client has waiting already.
    pub fn add(&mut self, client: &Arc<str>, item: T) {
        let own = self.waiting.entry(client.clone()).or_default();
        own.push_back(item);
        if own.len() == 1 {
            let round = self.ahead.remove(client).unwrap_or(0).max(self.round);
            self.enter(round, client.clone());
        }
    }

    /// What is next, of those clients that `may` have it; its client is due again a round later.
    pub fn next(&mut self, may: impl Fn(&Arc<str>) -> bool) -> Option<(Arc<str>, T)> {
        let (&place, _) = self.due.iter().find(|(_, client)| may(client))?;
        let client = self.due.remove(&place)?;
        let own = self.waiting.get_mut(&client)?;
        let item = own.pop_front()?;
        let again = place.0 + 1;
        if place.0 > self.round {
            self.round = place.0;
            let round = self.round;
            self.ahead.retain(|_, due| *due > round);
        }
        // Who has nothing waiting, and no more than others behind it, is forgotten, so that the tables stay as small as
        // the number of those who have.
        if own.is_empty() {
            self.waiting.remove(&client);
            if self.ahead.len() >= MOST_REMEMBERED {
                self.ahead.clear();
            }
            self.ahead.insert(client.clone(), again);
        } else {
            self.enter(again, client.clone());
        }
        Some((client, item))
    }

    fn enter(&mut self, round: u64, client: Arc<str>) {
        self.come += 1;
        self.due.insert((round, self.come), client);
    }
}

/// Something that a thread does.
type Work = Box<dyn FnOnce() + Send>;

/// Work that waits for the threads of a pool.
#[derive(Clone, Default)]
pub struct Turns(Arc<Mutex<Seats>>);

#[derive(Default)]
struct Seats {
    lines: Lines<Work>,
    /// Those that work is being done in.
    taken: usize,
}

impl Turns {
    /// Has `pool` do the work when it is the client's turn.
    ///
    /// No more work is given to the pool than it has threads: a thread that waits for its part of a parallel loop takes
    /// up whatever else the pool has to do, and would put a whole piece of somebody else's work, and others within
    /// that, before the end of its own.
    pub fn spawn(&self, pool: &rayon::ThreadPool, client: &Arc<str>, work: impl FnOnce() + Send + 'static) {
        let mut seats = self.lock();
        seats.lines.add(client, Box::new(work));
        if seats.taken < pool.current_num_threads() {
            seats.taken += 1;
            let turns = self.clone();
            pool.spawn(move || turns.work());
        }
    }

    /// Does whatever is next, and has the pool go on with the one after it. It goes by way of the pool: a thread that
    /// waits for a part of its own work, and does this meanwhile, comes back to it after each piece.
    fn work(self) {
        let next = {
            let mut seats = self.lock();
            let next = seats.lines.next(|_| true);
            seats.taken -= usize::from(next.is_none());
            next
        };
        if let Some((_, work)) = next {
            work();
            rayon::spawn(move || self.work());
        }
    }

    fn lock(&self) -> MutexGuard<'_, Seats> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn clients_take_turns_and_each_keeps_its_order() {
        let mut lines = Lines::default();
        let (a, b, c): (Arc<str>, Arc<str>, Arc<str>) = ("a".into(), "b".into(), "c".into());
        for item in ["a1", "a2", "a3", "a4"] {
            lines.add(&a, item);
        }
        lines.add(&b, "b1");
        assert_eq!(lines.next(|_| true), Some((a.clone(), "a1")));
        // Another one comes while the first two have something waiting.
        lines.add(&c, "c1");
        lines.add(&b, "b2");
        let mut order = Vec::new();
        while let Some((_, item)) = lines.next(|_| true) {
            order.push(item);
        }
        assert_eq!(order, ["b1", "c1", "a2", "b2", "a3", "a4"]);
        assert!(lines.due.is_empty() && lines.waiting.is_empty());
    }

    #[test]
    fn whoever_comes_again_and_again_takes_turns_with_whoever_waits() {
        let mut lines = Lines::default();
        let (flood, other): (Arc<str>, Arc<str>) = ("flood".into(), "other".into());
        (0..10).for_each(|item| lines.add(&flood, item));
        let mut order = Vec::new();
        for item in 100..105 {
            lines.add(&other, item);
            order.extend([lines.next(|_| true).unwrap().1, lines.next(|_| true).unwrap().1]);
        }
        assert_eq!(order, [0, 100, 1, 101, 2, 102, 3, 103, 4, 104]);
        // Those who come for the first time do not wait behind what the flood was due before.
        lines.add(&"new".into(), 200);
        assert_eq!(lines.next(|_| true).unwrap().1, 200);
        (0..1000).for_each(|number| {
            lines.add(&format!("{number}").into(), number);
            lines.next(|_| true);
        });
        assert!(lines.ahead.len() <= 1003, "those who came once, the flood and the other");
        while lines.next(|_| true).is_some() {}
        assert!(lines.ahead.len() <= 2 && lines.waiting.is_empty(), "{:?}", lines.ahead);
    }

    #[test]
    fn who_may_not_have_anything_is_passed_over_and_keeps_its_place() {
        let mut lines = Lines::default();
        let (a, b): (Arc<str>, Arc<str>) = ("a".into(), "b".into());
        for (client, item) in [(&a, 1), (&b, 2), (&b, 3)] {
            lines.add(client, item);
        }
        assert_eq!(lines.next(|client| *client == b), Some((b.clone(), 2)));
        assert_eq!(lines.next(|_| false), None);
        assert_eq!(lines.next(|_| true), Some((a, 1)));
        assert_eq!(lines.next(|_| true), Some((b, 3)));
        assert_eq!(lines.next(|_| true), None);
    }

    #[test]
    fn on_a_pool_whoever_has_had_nothing_is_next() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let turns = Turns::default();
        let (busy, modest): (Arc<str>, Arc<str>) = ("busy".into(), "modest".into());
        let ((begun, running), (go_on, gate)) = (mpsc::channel(), mpsc::channel());
        turns.spawn(&pool, &busy, move || {
            begun.send(()).unwrap();
            gate.recv().unwrap();
        });
        running.recv().unwrap();
        let (sender, done) = mpsc::channel();
        for number in 0..50 {
            let sender = sender.clone();
            turns.spawn(&pool, &busy, move || sender.send(number).unwrap());
        }
        turns.spawn(&pool, &modest, move || sender.send(-1).unwrap());
        go_on.send(()).unwrap();
        let order: Vec<i32> = done.iter().collect();
        let expected: Vec<i32> = (-1..50).collect();
        assert_eq!(order, expected);
    }

    #[test]
    fn work_that_waits_for_its_own_threads_does_not_take_up_that_of_others() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let turns = Turns::default();
        let client: Arc<str> = "busy".into();
        let (sender, done) = mpsc::channel();
        // Pieces that are within one another on a thread: a thread that waits for a part of one may take up parts of
        // others, but no whole one.
        thread_local!(static WITHIN: std::cell::Cell<usize> = const { std::cell::Cell::new(0) });
        for _ in 0..200 {
            let sender = sender.clone();
            turns.spawn(&pool, &client, move || {
                WITHIN.set(WITHIN.get() + 1);
                let depth = WITHIN.get();
                let part = || (0..20_000).map(|i| f64::from(i).sqrt()).sum::<f64>();
                let sums = rayon::join(|| rayon::join(part, part), || rayon::join(part, part));
                assert!(sums.0.0 == sums.1.1);
                WITHIN.set(WITHIN.get() - 1);
                sender.send(depth).unwrap();
            });
        }
        drop(sender);
        // Both seats may be given out before either thread takes one up.
        assert!(done.iter().all(|depth| depth <= 2));
        // The last one is answered before its thread looks for more.
        while turns.lock().taken > 0 {
            std::thread::yield_now();
        }
    }
}
