//! Two bases of one surface, compared function by function, and modes followed from one to the other.

use chladni_base::Monitor;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::following::{self, FollowedCluster, FollowedMode, Following};
use chladni_spectral::analysis::subspace::{Eigenspace, MOST_PAIRS, compare};
use chladni_spectral::basis::Basis;
use serde::{Deserialize, Serialize};

use crate::table::Table;

/// Which bases, and how they are compared.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"reference": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "other": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33", "pairs": 100})))]
pub struct BasisComparisonRequest {
    /// The id of the basis that the other one is projected on, an exact one for instance; inner products are by its
    /// mass.
    pub reference: String,
    /// The id of the other basis, on as many vertices.
    pub other: String,
    /// How many of the first pairs of both; without it, as many as both have, at most 1000.
    pub pairs: Option<usize>,
    /// Eigenvalues of the reference that follow on each other with at most this relative gap are one cluster; for
    /// modes that are followed those of either basis.
    #[serde(default = "one_percent")]
    #[cfg_attr(feature = "schema", schema(default = 0.01))]
    pub gap: f64,
    /// Whether to give all Fourier coefficients.
    #[serde(default)]
    pub coefficients: bool,
    /// Whether to say which mode of the other basis follows each one of the reference, as from one frame of an
    /// animation to the next.
    #[serde(default)]
    pub following: bool,
}

fn one_percent() -> f64 {
    0.01
}

/// A cluster of eigenvalues, and the spaces of its functions.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct EigenspaceAnswer {
    /// Its first mode.
    pub from: usize,
    /// The mode after its last.
    pub to: usize,
    /// The principal angles between its spaces in the two bases, in radians, ascending.
    pub angles: Vec<f64>,
    /// The sine of the largest: the distance of the two spaces.
    pub error: f64,
}

impl From<Eigenspace> for EigenspaceAnswer {
    fn from(Eigenspace { modes, angles }: Eigenspace) -> Self {
        let error = angles.last().copied().unwrap_or(0.0).sin();
        Self { from: modes.start, to: modes.end, angles, error }
    }
}

/// What follows a mode of the reference.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FollowedModeAnswer {
    /// The mode of the other basis, counted from 0; null where the overlap is below a half.
    pub mode: Option<usize>,
    /// 1, or −1 where that function has the other sign; within a cluster its rotation counts instead.
    pub sign: i8,
    /// The cosine of the angle between the function and what follows it, in the mass of the reference; within a cluster
    /// after its rotation.
    pub overlap: f64,
    /// Whether it follows for sure: its square is at least 0.8, so that no other has more than half of the overlap.
    pub sure: bool,
}

impl From<FollowedMode> for FollowedModeAnswer {
    fn from(FollowedMode { follower, sign, overlap, sure }: FollowedMode) -> Self {
        Self { mode: follower, sign: if sign < 0.0 { -1 } else { 1 }, overlap, sure }
    }
}

/// Modes that are followed together, since eigenvalues lie close together in one basis or the other.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FollowedClusterAnswer {
    /// Modes of the reference, ascending.
    pub modes: Vec<usize>,
    /// Modes of the other basis, each at the place of the mode that it follows.
    pub followers: Vec<usize>,
    /// The orthogonal matrix that turns the functions of the followers to those of the modes: a row for each follower,
    /// a column for each mode.
    pub rotation: Table,
}

impl From<FollowedCluster> for FollowedClusterAnswer {
    fn from(FollowedCluster { modes, followers, rotation }: FollowedCluster) -> Self {
        Self { modes, followers, rotation: Table::from(&rotation) }
    }
}

/// Modes of the reference, followed to the other basis.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FollowingAnswer {
    /// What follows each mode of the reference.
    pub modes: Vec<FollowedModeAnswer>,
    /// Two and more modes that are followed together, by the first of them.
    pub clusters: Vec<FollowedClusterAnswer>,
}

impl From<Following> for FollowingAnswer {
    fn from(Following { modes, clusters }: Following) -> Self {
        Self {
            modes: modes.into_iter().map(FollowedModeAnswer::from).collect(),
            clusters: clusters.into_iter().map(FollowedClusterAnswer::from).collect(),
        }
    }
}

/// Two bases, compared.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "same_mesh": true, "pairs": 2, "eigenvalue_errors": [0.0, 0.003], "projection_errors": [0.0, 0.01], "angles": [0.0, 0.01],
    "eigenspaces": [{"from": 0, "to": 1, "angles": [0.0], "error": 0.0}, {"from": 1, "to": 2, "angles": [0.01], "error": 0.01}], "coefficients": null,
    "following": {"modes": [{"mode": 0, "sign": 1, "overlap": 1.0, "sure": true}, {"mode": 1, "sign": -1, "overlap": 0.9999, "sure": true}], "clusters": []}
})))]
pub struct BasisComparisonAnswer {
    /// Whether both bases are of one mesh, or one problem; null where that is not known, as of two files. If they are
    /// not, their vertices are matched by their numbers alone, as those of one shape in two poses.
    pub same_mesh: Option<bool>,
    /// How many pairs were compared.
    pub pairs: usize,
    /// Per pair the eigenvalue of the other basis less that of the reference, over that.
    pub eigenvalue_errors: Vec<f64>,
    /// Per function of the other basis, which share of it lies outside of the functions of the reference, in the norm
    /// of the mass.
    pub projection_errors: Vec<f64>,
    /// The principal angles between the spans of all the functions, in radians, ascending.
    pub angles: Vec<f64>,
    /// Clusters of eigenvalues, with the angles between their spaces: single functions of one mean nothing.
    pub eigenspaces: Vec<EigenspaceAnswer>,
    /// Fourier coefficients: a row for each function of the reference, a column for each of the other basis.
    pub coefficients: Option<Table>,
    /// Which mode of the other basis follows each one of the reference, where that was asked for.
    pub following: Option<FollowingAnswer>,
}

/// Why bases cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum BasisComparisonFault {
    /// They are of different meshes.
    #[error("the reference has {reference} vertices and the other basis {other}")]
    Vertices {
        /// Vertices of the reference.
        reference: usize,
        /// Vertices of the other basis.
        other: usize,
    },
    /// A number does not fit, or the work was cancelled.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}

impl BasisComparisonRequest {
    /// Checks that the bases are on as many vertices.
    ///
    /// # Errors
    /// [`BasisComparisonFault::Vertices`].
    pub fn check(reference: &Basis, other: &Basis) -> Result<(), BasisComparisonFault> {
        let (reference, other) = (reference.vertices(), other.vertices());
        if reference == other { Ok(()) } else { Err(BasisComparisonFault::Vertices { reference, other }) }
    }

    /// Compares two bases; `same_mesh` is what is known of their meshes.
    ///
    /// # Errors
    /// [`BasisComparisonFault`] names what does not fit.
    pub fn answer(
        &self,
        reference: &Basis,
        other: &Basis,
        same_mesh: Option<bool>,
        monitor: &dyn Monitor,
    ) -> Result<BasisComparisonAnswer, BasisComparisonFault> {
        Self::check(reference, other)?;
        let pairs = self.pairs.unwrap_or(reference.count().min(other.count()).min(MOST_PAIRS));
        let found = compare(reference, other, pairs, self.gap, monitor)?;
        let following = match self.following {
            true => {
                let values = [&reference.eigenvalues[..], &other.eigenvalues];
                Some(following::follow(&found.coefficients, &found.gram, values, self.gap, monitor)?.into())
            }
            false => None,
        };
        Ok(BasisComparisonAnswer {
            same_mesh,
            pairs,
            eigenvalue_errors: found.eigenvalue_errors,
            projection_errors: found.projection_errors,
            angles: found.angles,
            eigenspaces: found.eigenspaces.into_iter().map(EigenspaceAnswer::from).collect(),
            coefficients: self.coefficients.then(|| Table::from(&found.coefficients)),
            following,
        })
    }
}
