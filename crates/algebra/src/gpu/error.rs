//! Why a graphics card did not do what it was asked to.

use chladni_base::Cancelled;

/// Why work on a graphics card failed. All but the cancellation are reasons to do the work on the CPU instead.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// This build has no support for graphics cards.
    #[error("this build lacks the feature `gpu`")]
    NotBuilt,
    /// No adapter is there, or none that fits the choice.
    #[error("no adapter matches \"{wanted}\"; available: {found}")]
    NoAdapter {
        /// The choice, as it was configured.
        wanted: String,
        /// All adapters, in order.
        found: String,
    },
    /// The adapter is there but cannot be used.
    #[error("{adapter} cannot be used: {reason}")]
    Unusable {
        /// The adapter.
        adapter: String,
        /// What it lacks, or what its driver said.
        reason: String,
    },
    /// A kernel computes something else than its twin on the CPU.
    #[error("kernel {kernel} in {precision} differs by {difference:e} from its CPU counterpart")]
    SelfTest {
        /// The kernel.
        kernel: &'static str,
        /// `f32` or `f64`.
        precision: &'static str,
        /// The largest relative difference.
        difference: f64,
    },
    /// The device went away, for instance because its driver was reset.
    #[error("the device was lost: {reason}")]
    Lost {
        /// What the driver said.
        reason: String,
    },
    /// There is not enough memory on the device, or a buffer would be larger than it allows.
    #[error("could not allocate {bytes} bytes on the device")]
    Memory {
        /// What was asked for.
        bytes: u64,
    },
    /// The device did not answer in time.
    #[error("the device did not answer within {seconds} s")]
    TimedOut {
        /// The time it had.
        seconds: f64,
    },
    /// The driver refused a command.
    #[error("the driver refused a command: {reason}")]
    Refused {
        /// What it said.
        reason: String,
    },
    /// The result does not satisfy the equation it should solve.
    #[error("the result of the device is wrong: its relative residual is {residual:e}")]
    Wrong {
        /// The relative residual.
        residual: f64,
    },
    /// Pairs from a device that knows f32 alone could not be refined far enough, as where many values lie within a
    /// millionth of each other.
    #[error("refinement in f64 ended at a relative residual of {residual:e}")]
    NotRefined {
        /// The relative residual.
        residual: f64,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl GpuError {
    /// A stable identifier, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::NotBuilt => "not-built",
            Self::NoAdapter { .. } => "no-adapter",
            Self::Unusable { .. } => "unusable",
            Self::SelfTest { .. } => "self-test",
            Self::Lost { .. } => "lost",
            Self::Memory { .. } => "memory",
            Self::TimedOut { .. } => "timed-out",
            Self::Refused { .. } => "refused",
            Self::Wrong { .. } => "wrong-result",
            Self::NotRefined { .. } => "not-refined",
            Self::Cancelled(_) => "cancelled",
        }
    }

    /// Whether the device is of no more use after this.
    pub(super) fn is_final(&self) -> bool {
        !matches!(self, Self::Memory { .. } | Self::NotRefined { .. } | Self::Cancelled(_))
    }
}
