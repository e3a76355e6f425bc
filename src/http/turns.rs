//! Whose turn it is: clients take turns, however much one of them has waiting. In one line for all, whoever sends much would have everybody else wait behind it.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What waits, client by client, each in the order in which it came.
#[derive(Debug)]
pub struct Lines<T> {
    /// The clients that have something waiting, each of them once; the first one is next.
    clients: VecDeque<Arc<str>>,
    waiting: HashMap<Arc<str>, VecDeque<T>>,
}

impl<T> Default for Lines<T> {
    fn default() -> Self {
        Self { clients: VecDeque::new(), waiting: HashMap::new() }
    }
}

impl<T> Lines<T> {
    /// Has something wait for the client's turn, behind what the client has waiting already.
    pub fn add(&mut self, client: &Arc<str>, item: T) {
        let own = self.waiting.entry(client.clone()).or_default();
        if own.is_empty() {
            self.clients.push_back(client.clone());
        }
        own.push_back(item);
    }

    /// What is next, of those clients that `may` have it; its client is last then.
    pub fn next(&mut self, may: impl Fn(&Arc<str>) -> bool) -> Option<(Arc<str>, T)> {
        let at = self.clients.iter().position(may)?;
        let client = self.clients.remove(at)?;
        let own = self.waiting.get_mut(&client)?;
        let item = own.pop_front()?;
        // Who has nothing waiting is forgotten, so that the table stays as small as the number of those who have.
        if own.is_empty() {
            self.waiting.remove(&client);
        } else {
            self.clients.push_back(client.clone());
        }
        Some((client, item))
    }
}

/// Something that a thread does.
type Work = Box<dyn FnOnce() + Send>;

/// Work that waits for the threads of a pool.
#[derive(Clone, Default)]
pub struct Turns(Arc<Mutex<Lines<Work>>>);

impl Turns {
    /// Has `pool` do the work when it is the client's turn.
    pub fn spawn(&self, pool: &rayon::ThreadPool, client: &Arc<str>, work: impl FnOnce() + Send + 'static) {
        self.lock().add(client, Box::new(work));
        // The pool is asked as often as there is work, for whichever is next by then.
        let turns = self.clone();
        pool.spawn(move || {
            let next = turns.lock().next(|_| true);
            if let Some((_, work)) = next {
                work();
            }
        });
    }

    fn lock(&self) -> MutexGuard<'_, Lines<Work>> {
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
        assert_eq!(order, ["b1", "a2", "c1", "b2", "a3", "a4"]);
        assert!(lines.clients.is_empty() && lines.waiting.is_empty());
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
    fn on_a_pool_whoever_comes_last_waits_for_one_of_the_others() {
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
        let expected: Vec<i32> = [0, -1].into_iter().chain(1..50).collect();
        assert_eq!(order, expected);
    }
}
