"""Sparse pencils against SciPy and against dense solves."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

import chladni


def grid(rows, columns):
    """The Laplacian of a grid with its boundary fixed: eigenvalues are known."""
    line = lambda n: scipy.sparse.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1])  # noqa: E731
    exact = [4 * np.sin(np.pi * np.arange(1, n + 1) / (2 * n + 2)) ** 2 for n in (rows, columns)]
    return scipy.sparse.kronsum(line(columns), line(rows)).tocsr(), np.sort(np.add.outer(*exact).ravel())


def test_a_grid_has_its_eigenvalues_and_scipys_names():
    S, exact = grid(60, 45)
    values, vectors = found = chladni.eigsh(S, k=30)
    assert np.allclose(values, exact[:30], rtol=1e-10) and found.complete and vectors.shape == (2700, 30)
    assert np.allclose(vectors.T @ vectors, np.eye(30), atol=1e-9) and abs(S @ vectors - vectors * values).max() < 1e-8
    by_scipy = scipy.sparse.linalg.eigsh(S, 30, None, 0.0)[0]
    assert np.allclose(chladni.eigsh(S, 30, None, 0.0)[0], by_scipy, rtol=1e-10) and found[1] is vectors
    assert np.allclose(chladni.eigsh(S, k=7, return_eigenvectors=False), exact[:7], rtol=1e-10)
    assert len(chladni.eigsh(S).values) == 6
    assert np.allclose(chladni.eigsh(S.toarray(), k=3, tol=0).values, exact[:3], rtol=1e-10)
    for form in (S.tocsc(), S.tocoo(), scipy.sparse.csr_array(S), S.astype(np.float32), S.astype(np.int64)):
        assert np.allclose(chladni.eigsh(form, k=3).values, exact[:3], rtol=1e-6)


def test_masses_and_intervals(knot):
    for kind in ("barycentric", "consistent"):
        S, M = knot.laplacian(mass=kind)
        expected = chladni.eigs(knot, k=60, method="hsim", mass=kind)
        found = chladni.eigsh(S, k=60, M=M)
        assert np.allclose(found.values, expected.values, rtol=1e-8, atol=1e-8)
        assert np.allclose(found.vectors.T @ (M @ found.vectors), np.eye(60), atol=1e-8)
    bound = (expected.values[20] + expected.values[21]) / 2
    below = chladni.eigsh(S, M=M, below=bound)
    assert below.complete and np.allclose(below.values, expected.values[:21], rtol=1e-8, atol=1e-8)
    between = chladni.eigsh(S, M=M, between=(expected.values[7] * 0.999, bound))
    lower = expected.values[7] * 0.999
    assert between.certificate.first == (expected.values < lower).sum() and between.certificate.interval.lower == lower
    assert below.certificate.interval.to == bound and below.certificate.cut is None and np.allclose(between.values[-10:], expected.values[11:21], rtol=1e-8)
    diagonal = np.linspace(1, 3, S.shape[0])
    assert np.allclose(
        chladni.eigsh(S, k=5, M=diagonal).values, chladni.eigsh(S, k=5, M=scipy.sparse.diags(diagonal)).values, atol=1e-12
    )


def test_a_count_that_cuts_a_cluster_says_so():
    line = scipy.sparse.diags([-np.ones(79), np.r_[1, 2 * np.ones(78), 1], -np.ones(79)], [-1, 0, 1])
    copies = scipy.sparse.kron(scipy.sparse.identity(20), line) + 1e-3 * scipy.sparse.identity(1600)
    found = chladni.eigsh(copies, k=50)
    assert found.complete and found.certificate.cut == chladni.CutCluster(first=40, end=60)


def test_shifts_of_equal_distance_take_as_many_as_were_asked_for():
    S = scipy.sparse.diags([0.0, 0.0, 0.0, 0.6, 2.0, 3.0])
    found = chladni.eigsh(S, k=3, sigma=0.5)
    assert np.allclose(found.values, [0, 0, 0.6], atol=1e-12) and found.certificate.first == 1
    # One of three equal ones was left out.
    assert [(tie.index, tie.delivered) for tie in found.certificate.around.ties] == [(0, False), (1, True), (2, True)]


def test_shifts_inside_the_spectrum_take_the_nearest():
    S, exact = grid(50, 33)
    sigma = exact[40] + 0.3 * (exact[41] - exact[40])
    found = chladni.eigsh(S, k=8, sigma=sigma)
    nearest = np.sort(exact[np.argsort(abs(exact - sigma))[:8]])
    assert np.allclose(found.values, nearest, rtol=1e-9)
    assert np.isclose(exact[found.certificate.first], found.values[0]) and found.vectors.shape == (1650, 8)
    assert len(found.certificate.bounds) == len(found.certificate.residuals) == 8
    assert found.certificate.around == chladni.Around(sigma, ())


def test_indefinite_and_dense_ones_against_lapack():
    random = np.random.default_rng(3)
    S = scipy.sparse.random(300, 300, 0.02, random_state=random)
    S = (S + S.T).tocsr() - 0.5 * scipy.sparse.identity(300)
    R = scipy.sparse.random(300, 300, 0.01, random_state=random)
    M = (R @ R.T + scipy.sparse.identity(300)).tocsr()
    expected = scipy.linalg.eigh(S.toarray(), M.toarray(), eigvals_only=True)
    found = chladni.eigsh(S, k=12, M=M)
    assert found.complete and np.allclose(found.values, expected[:12], atol=1e-9) and expected[0] < 0


def test_fixed_rows_are_left_out():
    S, _ = grid(20, 20)
    fixed = np.arange(0, 400, 7)
    rest = np.setdiff1d(np.arange(400), fixed)
    found = chladni.eigsh(S, k=5, fixed=fixed)
    assert np.allclose(found.values, scipy.linalg.eigvalsh(S[rest][:, rest].toarray())[:5], atol=1e-10)
    assert (found.vectors[fixed] == 0).all()


def indefinite():
    return scipy.sparse.csr_matrix(np.diag(np.ones(100)) + np.diag(2 * np.ones(99), 1) + np.diag(2 * np.ones(99), -1))


@pytest.mark.parametrize(
    ("change", "arguments", "message"),
    [
        (lambda S: S, {"k": 0}, "^k must be at least 1, got 0"),
        (lambda S: S, {"k": 101}, "100"),
        (lambda S: S, {"which": "LM"}, "sigma"),
        (lambda S: S, {"which": "BE"}, "which"),
        (lambda S: S, {"sigma": 1.0, "below": 2.0}, "sigma"),
        (lambda S: S, {"tol": 1e-30}, "tolerance"),
        (lambda S: S[:50], {}, r"\(50, 100\)"),
        (lambda S: S * 1j, {}, "complex"),
        (lambda S: S * np.nan, {}, r"S\[0, 0\] is NaN"),
        (lambda S: scipy.sparse.triu(S), {}, r"not symmetric: S\[0, 1\]"),
        (lambda S: S, {"M": np.ones(99)}, "99"),
        (lambda S: S, {"M": -np.ones(100)}, r"M\[0, 0\] is -1"),
        (lambda S: S, {"M": indefinite()}, "positive definite"),
        (lambda S: S, {"fixed": [100]}, "row 100"),
        (lambda S: S, {"tol": "a"}, "tol must be a number, got 'a'"),
        (lambda S: S, {"below": "a"}, "below must be a number, got 'a'"),
        (lambda S: S, {"between": 3}, "between must be two numbers, got 3"),
        (lambda S: S, {"between": (0,)}, "two numbers"),
        (lambda S: S, {"sigma": 1j}, "sigma"),
        (lambda S: S, {"k": 10**20}, r"k must be less than 2\*\*64, got 1"),
        (lambda S: S, {"seed": 2**64}, "seed"),
        (lambda S: S, {"progress": 5}, "progress must be .*, got 5"),
        (lambda S: S, {"M": np.ma.masked_less(np.ones(100), 2)}, "masked"),
    ],
)
def test_refusals_name_the_entry(change, arguments, message):
    S, _ = grid(10, 10)
    with pytest.raises(chladni.ParameterError, match=message):
        chladni.eigsh(change(S), **arguments)
