//! The processes that train one run together, or the single one.
//!
//! Data-parallel training over MPI (Cargo feature `mpi`): every process holds the same networks, computes its share of a
//! step's scenes, and takes the same optimiser step on the sum of all gradients. Only rank zero writes and prints.
//!
//! All processes call the same collective operations in the same order. To keep that so when one of them fails, there is a
//! barrier before each exchange ([`ProcessGroup::barrier`]) and one at the end ([`ProcessGroup::conclude`]): a process with an
//! error goes straight to the latter, and the others learn of it at whichever barrier they wait.

use miette::{Diagnostic, Report, miette};
use thiserror::Error;

#[cfg(feature = "mpi")]
mod mpi_engine;
#[cfg(feature = "mpi")]
use mpi_engine::Engine;

/// The processes of a run.
#[derive(Default)]
pub struct ProcessGroup {
    #[cfg(feature = "mpi")]
    engine: Option<Engine>,
}

/// Which scenes of a step a process computes: number i where i mod `size` is `rank`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RankPartition {
    /// Number of the process, from 0.
    pub rank: usize,
    /// Processes, at least 1.
    pub size: usize,
}

impl RankPartition {
    /// All scenes.
    pub const WHOLE: Self = Self { rank: 0, size: 1 };

    /// Whether scene number `scene` of a step is in it.
    pub fn has(self, scene: usize) -> bool {
        scene % self.size == self.rank
    }
}

/// Another process failed and says why.
#[derive(Debug, Error, Diagnostic)]
#[error("process {rank} of the run failed")]
pub struct FailedElsewhere {
    /// The process.
    pub rank: usize,
}

/// What one process brings to a barrier.
#[derive(Clone, Copy)]
enum Status {
    /// It goes on, and may ask for a stop.
    Fine { stop: bool },
    /// It has an error to report.
    Failed,
}

impl ProcessGroup {
    /// Joins the processes started by the same launcher; a group of one where there is none.
    ///
    /// # Errors
    /// When MPI does not start, or this build knows none and several processes were started.
    pub fn join() -> Result<Self, Report> {
        #[cfg(feature = "mpi")]
        return match Engine::start() {
            Some(engine) => Ok(Self { engine: Some(engine) }),
            None => Err(miette!(
                help = "start it through mpirun, and see whether `mpirun -n 2 hostname` works",
                "MPI cannot be started in this process"
            )),
        };
        #[cfg(not(feature = "mpi"))]
        match launched() {
            0 | 1 => Ok(Self::default()),
            size => Err(miette!(
                help = "build with --features mpi, or start it without mpirun",
                "started as one of {size} MPI processes, but this program was built without MPI"
            )),
        }
    }

    /// Which scenes this process computes.
    pub fn partition(&self) -> RankPartition {
        #[cfg(feature = "mpi")]
        if let Some(engine) = &self.engine {
            return RankPartition { rank: engine.rank(), size: engine.size() };
        }
        RankPartition::WHOLE
    }

    /// Whether this process writes and prints.
    pub fn is_rank_zero(&self) -> bool {
        self.partition().rank == 0
    }

    /// Whether there are several processes.
    pub fn is_shared(&self) -> bool {
        self.partition().size > 1
    }

    /// Waits for all processes; whether any of them asks for a `stop`.
    ///
    /// # Errors
    /// When another process failed; this one has nothing to report then.
    pub fn barrier(&self, stop: bool) -> Result<bool, FailedElsewhere> {
        self.exchange_status(Status::Fine { stop })
    }

    /// The last barrier: `result` of the whole program, without an error that another process reports.
    ///
    /// # Errors
    /// `Some` report where this process is the one to print it, `None` where another one does.
    pub fn conclude(&self, result: Result<(), Report>) -> Result<(), Option<Report>> {
        match result {
            Ok(()) => self.exchange_status(Status::Fine { stop: false }).map(drop).map_err(|_| None),
            // It learned of the failure at a barrier; the one that failed awaits nobody any more.
            Err(report) if report.downcast_ref::<FailedElsewhere>().is_some() => Err(None),
            Err(report) => match self.exchange_status(Status::Failed) {
                Err(FailedElsewhere { rank }) if rank != self.partition().rank => Err(None),
                _ => Err(Some(report)),
            },
        }
    }

    /// The first failed process is the one that reports; it hears of itself as well.
    fn exchange_status(&self, status: Status) -> Result<bool, FailedElsewhere> {
        let (failed, stop) = match status {
            Status::Fine { stop } => (0.0, f64::from(u8::from(stop))),
            Status::Failed => (1.0, 0.0),
        };
        let rows = self.gather(&[failed, stop]);
        match rows.iter().position(|row| row[0] != 0.0) {
            Some(rank) => Err(FailedElsewhere { rank }),
            None => Ok(rows.iter().any(|row| row[1] != 0.0)),
        }
    }

    /// The `row` of every process, all of one length, in the order of their numbers.
    pub fn gather(&self, row: &[f64]) -> Vec<Vec<f64>> {
        #[cfg(feature = "mpi")]
        if let Some(engine) = &self.engine {
            return engine.gather(row);
        }
        vec![row.to_vec()]
    }

    /// The element-wise sum of the `values` of all processes, of one length; the same bits everywhere.
    pub fn sum(&self, values: Vec<f32>) -> Vec<f32> {
        #[cfg(feature = "mpi")]
        if let Some(engine) = &self.engine {
            return engine.sum(values);
        }
        values
    }
}

/// Processes that a launcher says it started, 0 if there is none.
#[cfg(not(feature = "mpi"))]
fn launched() -> usize {
    let of = |name: &str| std::env::var(name).ok()?.parse().ok();
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].into_iter().find_map(of).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_every_scene_once() {
        for size in 1..5 {
            let shares: Vec<RankPartition> = (0..size).map(|rank| RankPartition { rank, size }).collect();
            assert!((0..12).all(|scene| shares.iter().filter(|share| share.has(scene)).count() == 1));
        }
    }

    #[test]
    fn a_single_process_passes_its_own_barriers_and_reports_its_own_errors() {
        let group = ProcessGroup::default();
        assert!(group.is_rank_zero() && !group.is_shared());
        assert!(!group.barrier(false).unwrap() && group.barrier(true).unwrap());
        assert_eq!(group.sum(vec![1.0, 2.0]), [1.0, 2.0]);
        assert!(group.conclude(Ok(())).is_ok());
        let found = group.conclude(Err(miette::miette!("broken"))).unwrap_err();
        assert_eq!(found.expect("its own").to_string(), "broken");
        assert!(group.conclude(Err(FailedElsewhere { rank: 3 }.into())).unwrap_err().is_none());
    }
}
