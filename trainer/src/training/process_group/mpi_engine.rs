//! The collective operations over MPI.

use mpi::Threading;
use mpi::collective::SystemOperation;
use mpi::environment::Universe;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

/// MPI, ended when it is dropped; used from the thread that started it only.
pub(super) struct Engine {
    communicator: SimpleCommunicator,
    _universe: Universe,
}

impl Engine {
    /// `None` where MPI does not start.
    pub(super) fn start() -> Option<Self> {
        // Other threads compute and read, but only this one exchanges anything.
        let (universe, _) = mpi::initialize_with_threading(Threading::Funneled)?;
        Some(Self { communicator: universe.world(), _universe: universe })
    }

    /// Number of this process, from 0.
    pub(super) fn rank(&self) -> usize {
        self.communicator.rank() as usize
    }

    /// Number of processes.
    pub(super) fn size(&self) -> usize {
        self.communicator.size() as usize
    }

    pub(super) fn gather(&self, row: &[f64]) -> Vec<Vec<f64>> {
        let mut all = vec![0.0; row.len() * self.size()];
        self.communicator.all_gather_into(row, &mut all);
        all.chunks_exact(row.len().max(1)).map(<[f64]>::to_vec).collect()
    }

    pub(super) fn sum(&self, values: Vec<f32>) -> Vec<f32> {
        let mut sums = vec![0.0; values.len()];
        self.communicator.all_reduce_into(&values, &mut sums, SystemOperation::sum());
        sums
    }
}
