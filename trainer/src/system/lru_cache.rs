//! The most recently used values of larger sets, within limits of memory.
//!
//! Garments, their tensors and their embeddings share one [`MemoryBudget`]: whatever was not used for longest is dropped first,
//! of whatever kind it is. What was dropped can be made again, so a limit changes speed and memory but no result.

use std::any::Any;
use std::collections::HashMap;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Where a value lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Residence {
    /// Memory of the program.
    Host,
    /// Memory of the device that computes, which on a CPU backend is the program's as well.
    Device,
}

/// Bytes of kept values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeptBytes {
    /// All of them, those on the device included.
    pub total: usize,
    /// Those on the device.
    pub device: usize,
}

/// Limits on what is kept, shared by any number of [`LruCache`] sets. Values that someone still uses count, and are dropped
/// once they are no longer used: together never more is kept than the limit, or what is in use and the newest value.
#[derive(Debug)]
pub struct MemoryBudget {
    limits: KeptBytes,
    store: Mutex<Store>,
}

#[derive(Debug, Default)]
struct Store {
    kept: KeptBytes,
    most: KeptBytes,
    clock: u64,
    sets: u64,
    entries: HashMap<Place, CacheEntry>,
}

/// Number of the set, index in it.
type Place = (u64, usize);
type Value = Arc<dyn Any + Send + Sync>;

#[derive(Debug)]
struct CacheEntry {
    value: Value,
    bytes: usize,
    residence: Residence,
    last_use: u64,
}

impl MemoryBudget {
    /// Nothing kept yet.
    pub fn new(limits: KeptBytes) -> Arc<Self> {
        Arc::new(Self { limits, store: Mutex::default() })
    }

    /// The limits.
    pub fn limits(&self) -> KeptBytes {
        self.limits
    }

    /// Bytes kept now.
    pub fn kept(&self) -> KeptBytes {
        self.lock().kept
    }

    /// The most that was ever kept of each.
    pub fn most(&self) -> KeptBytes {
        self.lock().most
    }

    fn lock(&self) -> MutexGuard<'_, Store> {
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store {
    fn count(&mut self, entry: &CacheEntry, sign: fn(usize, usize) -> usize) {
        self.kept.total = sign(self.kept.total, entry.bytes);
        if entry.residence == Residence::Device {
            self.kept.device = sign(self.kept.device, entry.bytes);
        }
    }

    fn add(&mut self, place: Place, entry: CacheEntry) -> Option<Value> {
        self.count(&entry, |kept, bytes| kept + bytes);
        self.entries.insert(place, entry).map(|old| {
            self.count(&old, |kept, bytes| kept - bytes);
            old.value
        })
    }

    fn remove(&mut self, place: Place) -> Option<Value> {
        let entry = self.entries.remove(&place)?;
        self.count(&entry, |kept, bytes| kept - bytes);
        Some(entry.value)
    }

    /// The value that was not used for longest among those that nobody holds; dropping the others would free nothing.
    fn oldest(&self, newest: Place, only_device: bool) -> Option<Place> {
        let may_go = |(place, entry): &(&Place, &CacheEntry)| {
            **place != newest
                && !(only_device && entry.residence == Residence::Host)
                && Arc::strong_count(&entry.value) == 1
        };
        self.entries.iter().filter(may_go).min_by_key(|(_, entry)| entry.last_use).map(|(place, _)| *place)
    }

    /// Takes out what is over the limits.
    fn shrink(&mut self, newest: Place, limits: KeptBytes) -> Vec<Value> {
        let mut dropped = Vec::new();
        while self.kept.device > limits.device
            && let Some(place) = self.oldest(newest, true)
        {
            dropped.extend(self.remove(place));
        }
        while self.kept.total > limits.total
            && let Some(place) = self.oldest(newest, false)
        {
            dropped.extend(self.remove(place));
        }
        self.most.total = self.most.total.max(self.kept.total);
        self.most.device = self.most.device.max(self.kept.device);
        dropped
    }
}

/// Values by index, of a set of which only those used last are kept.
#[derive(Debug)]
pub struct LruCache<T> {
    budget: Arc<MemoryBudget>,
    set: u64,
    residence: Residence,
    values: PhantomData<fn() -> T>,
}

impl<T: Any + Send + Sync> LruCache<T> {
    /// An empty set within `budget`.
    pub fn new(budget: &Arc<MemoryBudget>, residence: Residence) -> Self {
        let mut store = budget.lock();
        store.sets += 1;
        let set = store.sets;
        drop(store);
        Self { budget: budget.clone(), set, residence, values: PhantomData }
    }

    /// An empty set of which everything is kept, for as long as it lives.
    pub fn unlimited() -> Self {
        Self::new(&MemoryBudget::new(KeptBytes { total: usize::MAX, device: usize::MAX }), Residence::Device)
    }

    /// The value of `index`, if it is still there.
    pub fn get(&self, index: usize) -> Option<Arc<T>> {
        let mut store = self.budget.lock();
        store.clock += 1;
        let last_use = store.clock;
        let entry = store.entries.get_mut(&(self.set, index))?;
        entry.last_use = last_use;
        entry.value.clone().downcast().ok()
    }

    /// Keeps a value of about `bytes` bytes.
    pub fn insert(&self, index: usize, value: T, bytes: usize) -> Arc<T> {
        let value = Arc::new(value);
        let place = (self.set, index);
        let mut store = self.budget.lock();
        store.clock += 1;
        let entry =
            CacheEntry { value: value.clone(), bytes, residence: self.residence, last_use: store.clock };
        let replaced = store.add(place, entry);
        let dropped = store.shrink(place, self.budget.limits);
        // Freeing large values takes time that nobody need wait for.
        drop(store);
        drop((replaced, dropped));
        value
    }
}

impl<T> Drop for LruCache<T> {
    fn drop(&mut self) {
        let mut store = self.budget.lock();
        let own: Vec<Place> = store.entries.keys().copied().filter(|(set, _)| *set == self.set).collect();
        let dropped: Vec<_> = own.into_iter().map(|place| store.remove(place)).collect();
        drop(store);
        drop(dropped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget(total: usize, device: usize) -> Arc<MemoryBudget> {
        MemoryBudget::new(KeptBytes { total, device })
    }

    fn kept(set: &LruCache<usize>, indices: impl IntoIterator<Item = usize>) -> Vec<Option<usize>> {
        indices.into_iter().map(|i| set.get(i).map(|value| *value)).collect()
    }

    #[test]
    fn the_least_recently_used_goes_first() {
        let recent = LruCache::new(&budget(30, 0), Residence::Host);
        for i in 0..3 {
            recent.insert(i, i * 10, 10);
        }
        assert_eq!(kept(&recent, [0]), [Some(0)]);
        recent.insert(3, 30, 10);
        assert_eq!(kept(&recent, 0..4), [Some(0), None, Some(20), Some(30)]);
        recent.insert(4, 40, 100);
        assert_eq!(kept(&recent, [0, 2, 3, 4]), [None, None, None, Some(40)], "one always stays");
        recent.insert(4, 41, 10);
        recent.insert(5, 50, 20);
        assert_eq!(kept(&recent, 4..6), [Some(41), Some(50)], "a replaced value gives its bytes back");
    }

    #[test]
    fn sets_share_a_limit_and_the_device_has_its_own() {
        let budget = budget(50, 20);
        let host = LruCache::new(&budget, Residence::Host);
        let device = LruCache::new(&budget, Residence::Device);
        for i in 0..4 {
            host.insert(i, i, 10);
            device.insert(i, i, 10);
        }
        assert_eq!(kept(&device, 0..4), [None, None, Some(2), Some(3)], "20 bytes on the device");
        assert_eq!(kept(&host, 0..4), [None, Some(1), Some(2), Some(3)], "the oldest of either made room");
        assert_eq!(budget.kept(), KeptBytes { total: 50, device: 20 });
        drop(device);
        assert_eq!(budget.kept(), KeptBytes { total: 30, device: 0 });
        assert_eq!(budget.most(), KeptBytes { total: 50, device: 20 });
    }

    #[test]
    fn what_is_in_use_counts_and_stays_until_it_is_not() {
        let budget = budget(20, 0);
        let recent = LruCache::new(&budget, Residence::Host);
        let held = [0, 1, 2].map(|i| recent.insert(i, i, 10));
        assert_eq!(budget.kept().total, 30, "nothing would be freed");
        drop(held);
        recent.insert(3, 3, 10);
        assert_eq!(kept(&recent, 0..4), [None, None, Some(2), Some(3)]);
        assert_eq!(budget.kept().total, 20);
    }
}
