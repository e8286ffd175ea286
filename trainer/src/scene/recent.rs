//! The most recently used values of a larger set, within a limit of memory.

use std::collections::HashMap;

/// Values by index, the least recently used dropped first. What was dropped can be made again, so a limit changes speed
/// and memory but no result.
#[derive(Debug)]
pub struct Recent<T> {
    limit: usize,
    used: usize,
    clock: u64,
    entries: HashMap<usize, Entry<T>>,
}

#[derive(Debug)]
struct Entry<T> {
    value: T,
    bytes: usize,
    last_use: u64,
}

impl<T: Clone> Recent<T> {
    /// Keeps at most `limit` bytes (and always the newest value).
    pub fn new(limit: usize) -> Self {
        Self { limit, used: 0, clock: 0, entries: HashMap::new() }
    }

    /// The value of `index`, if it is still there.
    pub fn get(&mut self, index: usize) -> Option<T> {
        self.clock += 1;
        let entry = self.entries.get_mut(&index)?;
        entry.last_use = self.clock;
        Some(entry.value.clone())
    }

    /// Keeps a value of about `bytes` bytes.
    pub fn insert(&mut self, index: usize, value: T, bytes: usize) {
        self.clock += 1;
        let entry = Entry { value, bytes, last_use: self.clock };
        self.used += bytes;
        if let Some(old) = self.entries.insert(index, entry) {
            self.used -= old.bytes;
        }
        while self.used > self.limit && self.entries.len() > 1 {
            let oldest = self.entries.iter().min_by_key(|(_, e)| e.last_use).map(|(&i, _)| i);
            let dropped = oldest.and_then(|i| self.entries.remove(&i));
            self.used -= dropped.map_or(0, |e| e.bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_goes_first() {
        let mut recent = Recent::new(30);
        for i in 0..3 {
            recent.insert(i, i * 10, 10);
        }
        assert_eq!(recent.get(0), Some(0));
        recent.insert(3, 30, 10);
        assert_eq!([0, 1, 2, 3].map(|i| recent.get(i)), [Some(0), None, Some(20), Some(30)]);
        recent.insert(4, 40, 100);
        assert_eq!([0, 2, 3, 4].map(|i| recent.get(i)), [None, None, None, Some(40)], "one always stays");
        recent.insert(4, 41, 10);
        recent.insert(5, 50, 20);
        assert_eq!(
            [4, 5].map(|i| recent.get(i)),
            [Some(41), Some(50)],
            "a replaced value gives its bytes back"
        );
    }
}
