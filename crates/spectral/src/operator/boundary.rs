//! The Dirichlet condition: boundary vertices are taken out of the unknowns.

use super::{EigenProblem, OperatorError};

/// The problem without the rows and columns of `removed` vertices, given in any order. Its size is unchanged, and its
/// mass no longer sums to 1.
///
/// # Errors
/// [`OperatorError::NoUnknowns`] where no vertex is left.
pub(crate) fn without(problem: &EigenProblem, removed: &[u32]) -> Result<EigenProblem, OperatorError> {
    let n = problem.size();
    let mut kept = vec![true; n];
    removed.iter().for_each(|&v| kept[v as usize] = false);
    let unknowns: Vec<u32> = (0..n as u32).filter(|&v| kept[v as usize]).collect();
    if unknowns.is_empty() {
        return Err(OperatorError::NoUnknowns { vertices: n });
    }
    let (stiffness, mass) = (problem.stiffness.principal(&unknowns), problem.mass.principal(&unknowns));
    Ok(EigenProblem { stiffness, mass, area: problem.area, unknowns: Some(unknowns) })
}
