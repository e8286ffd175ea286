//! What the machine provides: device, memory, threads, signals, paths. Nothing here knows garments or networks.

pub mod allocator;
pub mod closed_pipe;
pub mod device;
pub mod exact;
pub mod files;
pub mod limits;
pub mod lru_cache;
pub mod memory;
pub mod paths;
pub mod prefetch;
pub mod single_threaded;
pub mod stop;
pub mod workers;
