"""Eigenpairs of any sparse symmetric pencil, by the names of SciPy."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Callable, Iterator

import numpy as np

from . import _arrays, _native
from ._certificate import Certificate

__all__ = ["Eigenpairs", "eigsh"]

#: The least tolerance, which SciPy's 0 stands for.
_LEAST = 1e-10


@dataclass(frozen=True, eq=False)
class Eigenpairs:
    """Eigenpairs of a pencil. It unpacks as SciPy's answer does: ``values, vectors = eigsh(…)``.

    Attributes
    ----------
    values : numpy.ndarray, (k,)
        Eigenvalues, ascending.
    vectors : numpy.ndarray, (n, k)
        Eigenvectors as columns, orthonormal for the mass; in each the entry of largest magnitude is positive.
    certificate : Certificate
        What is proven. Residuals are relative to ``‖(S + c M) x‖``, where `c` is `moved`.
    moved : float
        The multiple of the mass that residuals are relative to: zero for semi-definite matrices with a kernel of constants at most.
    """

    values: np.ndarray
    vectors: np.ndarray
    certificate: Certificate
    moved: float

    @property
    def complete(self) -> bool | None:
        """Whether it is proven that no pair is missing."""
        return self.certificate.complete

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter((self.values, self.vectors))

    def __len__(self) -> int:
        return 2

    def __getitem__(self, place: int | slice) -> Any:
        return (self.values, self.vectors)[place]

    def __repr__(self) -> str:
        return f"<chladni.Eigenpairs: {len(self.values)} pairs of {len(self.vectors)} rows, {self.certificate!r}>"


def eigsh(
    S: Any,
    k: int | None = None,
    M: Any = None,
    sigma: float | None = None,
    which: str | None = None,
    *,
    tol: float = 1e-8,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    fixed: Any = (),
    seed: int = 0,
    return_eigenvectors: bool = True,
    progress: bool | Callable[[str, float], Any] = False,
) -> Any:
    """Lowest eigenpairs of ``S x = λ M x``, proven complete: SciPy's ``eigsh`` in which no pair is missing.

    Parameters
    ----------
    S : sparse matrix or array_like, (n, n)
        Symmetric; it need not be definite.
    k : int, optional
        How many pairs; 6 by default. With `below` or `between` the most that may be delivered (more are an error).
    M : sparse matrix or array_like, (n, n) or (n,), optional
        The mass: symmetric and positive definite, or a diagonal of positive numbers. The identity by default.
    sigma : float, optional
        Without it, or where it lies below the spectrum, the lowest pairs. Else the `k` whose eigenvalues are nearest to it, which the certificate proves; all pairs below it are computed on the way.
    which : {"SA", "LM"}, optional
        ``"SA"``: the lowest. ``"LM"``, which needs `sigma`: those nearest to it.
    tol : float
        The largest residual of a pair, 1e-10 to 0.5; 0 means the least. Eigenvalues are as exact as its square.
    below : float, optional
        All pairs whose eigenvalue lies below this.
    between : (float, float), optional
        All pairs whose eigenvalue is at least the first and below the second.
    fixed : array_like of int, optional
        Rows whose entries are zero in every vector (Dirichlet): they and their columns are left out.
    seed : int
        Seeds everything that is drawn at random: same seed, same answer.
    return_eigenvectors : bool
        Whether the answer is `Eigenpairs`, or the eigenvalues alone.
    progress : bool or callable
        As for `eigs`.

    Returns
    -------
    Eigenpairs or numpy.ndarray, (k,)

    Raises
    ------
    ParameterError
        The first entry that makes a matrix unsymmetric, infinite, or a mass indefinite is named.
    UnprovenError
        The pairs did not converge, or could not be proven complete.

    Examples
    --------
    >>> import chladni, numpy, scipy.sparse
    >>> path = scipy.sparse.diags([-numpy.ones(99), numpy.r_[1, 2 * numpy.ones(98), 1], -numpy.ones(99)], [-1, 0, 1])
    >>> values, vectors = found = chladni.eigsh(path, k=4)
    >>> bool(abs(values - (2 - 2 * numpy.cos(numpy.pi * numpy.arange(4) / 100))).max() < 1e-12), found.complete
    (True, True)
    >>> path.data[0, 5] = 7
    >>> chladni.eigsh(path, k=4)
    Traceback (most recent call last):
        ...
    chladni.ParameterError: S is not symmetric: S[5, 6] is -1, S[6, 5] is 7
    """
    _check_wanted(sigma, which, tol, below, between)
    interval = below is not None or between is not None
    stiffness = _csr(S, "S")
    n = stiffness.shape[0]
    diagonal, mass = _mass(M, n)
    rows, _ = _arrays.vertex_list(fixed, "fixed", "row") if np.size(fixed) else ([], False)
    request: dict[str, Any] = {"tolerance": _arrays.number(tol, "tol") or _LEAST, "seed": _arrays.whole(seed, "seed"), "most": n if k is None else _arrays.whole(k, "k", least=1)}
    if below is not None:
        request["below"] = _arrays.number(below, "below")
    if between is not None:
        request["between"] = [_arrays.number(end, "between") for end in between]
    told, close = _arrays.progress_callback(progress)
    if sigma is not None:
        request["around"], request["most"] = _arrays.number(sigma, "sigma"), n
    if not interval:
        request["count"] = 6 if k is None else _arrays.whole(k, "k", least=1)
    try:
        arguments = _parts(stiffness), diagonal, None if mass is None else _parts(mass), rows
        values, vectors, certificate, moved = _native.pencil(n, *arguments, json.dumps(request), told)
        found = Eigenpairs(values, vectors, Certificate._of_json(certificate), moved)
    finally:
        close()
    return found if return_eigenvectors else found.values


def _check_wanted(
    sigma: float | None, which: str | None, tol: float, below: float | None, between: tuple[float, float] | None
) -> None:
    """That pairs are told in one way."""
    if which is not None:
        _arrays.flag(which, "which", ("SA", "LM"))
        if which == "LM" and sigma is None:
            raise _arrays.parameter_error("which is 'LM' without sigma, but the lowest pairs are computed; call with -S for the largest")
        if which == "SA" and sigma is not None:
            raise _arrays.parameter_error("which='SA' (the lowest) does not take sigma")
    if below is not None and between is not None:
        raise _arrays.parameter_error("give either below or between, not both")
    if sigma is not None and not (below is None and between is None):
        raise _arrays.parameter_error("sigma goes with a number of pairs, not with below or between")
    for name, given in (("below", below), ("sigma", sigma), ("tol", tol)):
        if given is not None:
            _arrays.number(given, name)
    if between is not None:
        if np.ndim(between) != 1 or len(between) != 2:
            raise _arrays.parameter_error(f"between must be two numbers, got {between!r}")
        first, second = (_arrays.number(end, "between") for end in between)
        if not first < second:
            raise _arrays.parameter_error(f"between must have the lower bound first, got {between}")


def _csr(matrix: Any, name: str) -> Any:
    """A matrix in CSR with float64 entries."""
    import scipy.sparse

    if not scipy.sparse.issparse(matrix):
        matrix = _arrays.numeric(matrix, name)
        if matrix.ndim != 2:
            raise _arrays.parameter_error(f"{name} must have shape (n, n), got {matrix.shape}")
    if matrix.dtype.kind not in "fiub":
        raise _arrays.parameter_error(f"{name} must be real numbers, got dtype {matrix.dtype}")
    if matrix.shape[0] != matrix.shape[1]:
        raise _arrays.parameter_error(f"{name} must have shape (n, n), got {matrix.shape}")
    return scipy.sparse.csr_matrix(matrix, dtype=np.float64)


def _mass(M: Any, n: int) -> tuple[np.ndarray | None, Any]:
    """The diagonal of a mass, or the whole matrix; neither of the identity."""
    import scipy.sparse

    if M is None:
        return None, None
    if not scipy.sparse.issparse(M):
        given = _arrays.numeric(M, "M")
        if given.ndim == 1:
            if len(given) != n:
                raise _arrays.parameter_error(f"M must have {n} entries, got {len(given)}")
            return np.ascontiguousarray(given), None
    matrix = _csr(M, "M")
    if matrix.shape[0] != n:
        raise _arrays.parameter_error(f"M must have shape ({n}, {n}), got {matrix.shape}")
    coordinates = matrix.tocoo()
    if (coordinates.row == coordinates.col).all():
        return np.ascontiguousarray(matrix.diagonal()), None
    return None, matrix


def _parts(matrix: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        matrix.indptr.astype(np.uint64),
        np.ascontiguousarray(matrix.indices, dtype=np.uint32),
        np.ascontiguousarray(matrix.data, dtype=np.float64),
    )
