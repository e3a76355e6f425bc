//! What the parts of a problem take, and whoever plans and joins them: docs/decisions/0127 and 0132.

use std::num::NonZeroUsize;

use chladni_base::Monitor;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::operator::LaplacianByRows;
use chladni_spectral::spectrum::approximate_parts::{self, ROWS_AT_ONCE, ROWS_OF_PIECE};
use chladni_spectral::spectrum::hsim::{HsimParameters, Wanted};

use super::approximation::panels_at_once;
use super::{Approximate, EigenbasisParameters, Exact, MOST_PARTS, Method};
use crate::{JobError, JobParameters, MeshSize};

/// Pairs that slices have beyond their share, those of their neighbours and guards.
pub(super) const BESIDE: usize = 64;

/// The program itself, and what it keeps of what was let go of.
const PROGRAM: u64 = 110 << 20;

/// Of a vertex, while a plan is made.
const PLAN_BYTES: u64 = 130;

/// Of a vertex, while parts are joined; and what is held beside, whatever their size.
const JOIN_BYTES: u64 = 262;
const BESIDE_JOIN: u64 = 40 << 20;

/// Into how many parts a job is divided, and what it takes to solve one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    /// The number of parts.
    pub parts: NonZeroUsize,
    /// An estimate of the memory that one of them needs, in bytes.
    pub memory_bytes: u64,
}

impl JobParameters {
    /// An estimate of the memory that the job needs, in bytes, where it is divided if that takes less: a job that
    /// leaves it to the server whether it is divided otherwise counts as one in one piece.
    pub fn memory_bytes_in_parts(&self, mesh: MeshSize) -> u64 {
        let most = self.memory_bytes(mesh);
        let Self::Eigenbasis(parameters) = self else { return most };
        parameters.bytes_in_parts(mesh).map_or(most, |bytes| bytes.min(most))
    }

    /// An estimate of the memory that the job needs where it is not divided after all, in bytes.
    pub fn memory_bytes_in_one_piece(&self, mesh: MeshSize) -> u64 {
        match self {
            Self::Eigenbasis(parameters) => parameters.bytes_in_one_piece(mesh),
            _ => self.memory_bytes(mesh),
        }
    }

    /// Makes sure that a job that was to be divided, and may have been promised no more than that takes, may be done in
    /// one piece.
    pub(super) fn has_room_for_one_piece(&self, mesh: MeshSize, monitor: &dyn Monitor) -> Result<(), JobError> {
        let Self::Eigenbasis(parameters) = self else { return Ok(()) };
        let Some(promised) = monitor.promised_bytes().filter(|_| parameters.bytes_in_parts(mesh).is_some()) else {
            return Ok(());
        };
        // It was promised by a server, whose threads may be fewer than those here.
        let needed = self.memory_bytes_in_one_piece(mesh);
        if needed <= promised.saturating_add(promised / 4) {
            Ok(())
        } else {
            Err(JobError::Memory { needed, promised })
        }
    }

    /// An estimate of the memory that one of so many parts needs, in bytes, whatever the mesh is like.
    pub fn part_memory_bytes(&self, mesh: MeshSize, parts: NonZeroUsize) -> u64 {
        let Self::Eigenbasis(parameters) = self else { return self.memory_bytes(mesh) };
        let exact = match &parameters.method {
            Method::Exact(exact) => exact,
            // Columns may be made of the whole surface; its own rows are written beside.
            _ => {
                return Self::Eigenbasis(EigenbasisParameters { parts: None, ..parameters.clone() }).memory_bytes(mesh);
            }
        };
        let share = exact.most_pairs().div_ceil(parts.get()) + BESIDE;
        let solver = HsimParameters { wanted: Wanted::Count(share.min(exact.most_pairs())), ..exact.solver };
        let method = Method::Exact(Exact { solver, ..exact.clone() });
        let of_part = EigenbasisParameters { method, parts: None, ..parameters.clone() };
        Self::Eigenbasis(of_part).memory_bytes(mesh)
    }

    /// The same for a mesh that is there, which may tell that less will do: the columns of an approximation are made a
    /// piece of the surface at a time where none of them belongs to a single vertex.
    ///
    /// # Errors
    /// [`JobError`], as [`run_body`](Self::run_body): what the mesh is not suited for, cancellation.
    pub fn part_memory_bytes_on(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        parts: NonZeroUsize,
        monitor: &dyn Monitor,
    ) -> Result<u64, JobError> {
        let size = MeshSize::of_body(mesh, solid);
        let most = self.part_memory_bytes(size, parts);
        let Self::Eigenbasis(parameters) = self else { return Ok(most) };
        let Some((approximate, problem)) = parameters.by_rows(mesh, monitor)? else { return Ok(most) };
        let less = parameters.is_by_pieces(approximate, &problem);
        Ok(if less { approximate.part_bytes(size, parts).min(most) } else { most })
    }

    /// An estimate of the memory that it takes to join parts on a mesh, in bytes.
    ///
    /// # Errors
    /// As [`part_memory_bytes_on`](Self::part_memory_bytes_on).
    pub fn join_memory_bytes_on(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<u64, JobError> {
        let size = MeshSize::of_body(mesh, solid);
        let most = self.memory_bytes(size);
        let Self::Eigenbasis(parameters) = self else { return Ok(most) };
        // A goal that parts miss is reached in one piece, unless there are too many vertices for that.
        if size.vertices < approximate_parts::TOLD_FROM {
            return Ok(most);
        }
        let Some((approximate, _)) = parameters.by_rows(mesh, monitor)? else { return Ok(most) };
        Ok(approximate.join_bytes(size).min(most))
    }
}

impl EigenbasisParameters {
    /// What a job takes in one piece, or what it takes to join its parts, where that is more.
    pub(super) fn bytes_in_one_piece(&self, size: MeshSize) -> u64 {
        self.memory_bytes(size.vertices, size.faces) + self.joined_bytes(size.vertices)
    }

    /// What a job takes that others solve the parts of: it makes the plan, and joins them. No less than one of its
    /// parts, the smallest that there may be where their number is left open: where nobody has room for a part, nothing
    /// comes of the whole. `None` where the job is not divided by the surface; whether the mesh is one that lets this
    /// be enough is for the plan to see.
    pub(super) fn bytes_in_parts(&self, size: MeshSize) -> Option<u64> {
        let (Method::Approximate(approximate), Some(parts)) = (&self.method, self.parts) else { return None };
        let own = approximate.plan_bytes(size).max(approximate.join_bytes(size));
        let parts = parts.number().or(NonZeroUsize::new(MOST_PARTS))?;
        Some(own.max(approximate.part_bytes(size, parts)))
    }

    /// The approximation, and its operator without a matrix, where that is enough for parts.
    fn by_rows<'a>(
        &self,
        mesh: &'a TriangleMesh,
        monitor: &dyn Monitor,
    ) -> Result<Option<(&Approximate, LaplacianByRows<'a>)>, JobError> {
        let Method::Approximate(approximate) = &self.method else { return Ok(None) };
        Ok(LaplacianByRows::new(mesh, &self.operator, monitor)?.map(|problem| (approximate, problem)))
    }

    /// Whether parts make their columns a piece at a time.
    pub(super) fn is_by_pieces(&self, approximate: &Approximate, problem: &LaplacianByRows<'_>) -> bool {
        approximate_parts::Parted::is_by_pieces(problem, &approximate.parameters(self.seed))
    }
}

impl Approximate {
    /// What a part takes: it makes its columns, a piece of the surface at a time, then it measures its rows, so many at
    /// a time. Bytes a vertex are measured ones.
    pub(super) fn part_bytes(&self, size: MeshSize, parts: NonZeroUsize) -> u64 {
        let (n, d, m) = (size.vertices as u64, self.dimension as u64, self.count as u64);
        let surface = 24 * n + 12 * size.faces as u64;
        // Edges, their lengths and weights, columns before they diffuse, where vertices lie on the coarse level; rows
        // of a piece of the operator. Each thread beyond two has a list of all vertices more.
        let threads = (rayon::current_num_threads() as u64).saturating_sub(2);
        let columns = surface + (255 + 8 * threads) * n + 330 * n.min(ROWS_OF_PIECE as u64);
        // Rows of the part and next to it, as many as are measured at a time with their hierarchy, and panels of 32
        // pairs.
        let own = n.div_ceil(parts.get() as u64);
        let at_once = own.min(ROWS_AT_ONCE as u64);
        let measured = surface + 40 * n + 240 * own + at_once * (460 + 800 * panels_at_once(own, m));
        PROGRAM + columns.max(measured) + d * d * 8 * 3 + d * m * 8 * 2
    }

    /// What a plan takes: the surface, the triangles of each vertex, and what tells whether edges are those of a
    /// manifold.
    fn plan_bytes(&self, size: MeshSize) -> u64 {
        let (n, f) = (size.vertices as u64, size.faces as u64);
        PROGRAM + 24 * n + 12 * f + PLAN_BYTES * n
    }

    /// What a join takes: the rows of all parts, twenty entries each and a little more, and half as much again while
    /// they are put in order; masses, where rows begin, and their numbers. The allocator gives back what was let go of
    /// meanwhile.
    fn join_bytes(&self, size: MeshSize) -> u64 {
        let (n, d, m) = (size.vertices as u64, self.dimension as u64, self.count as u64);
        let surface = 24 * n + 12 * size.faces as u64;
        PROGRAM + BESIDE_JOIN + surface + JOIN_BYTES * n + d * m * 8 * 4
    }
}

#[cfg(test)]
#[path = "part_memory_tests.rs"]
mod tests;
