"""Other eigensolvers for the lowest pairs of S x = λ M x: shift-invert Lanczos, Manifold Harmonics, LOBPCG and the multilevel correction scheme.

    python3 peers.py '{"mesh": "igea.ply", "subdivide": 0, "count": 50, "tolerance": 0.01, "peer": "lanczos", …}'

prints one line of JSON. The matrices are those that Chladni assembles, scaled to unit area, so that every solver has the same problem and the same shift. Each is
judged by the residual (4.6) of what it returns, ‖S x − λ M x‖ / ‖S x‖, by how orthonormal it is, and by an inertia count of its own. Seconds are of one thread, without reading and assembly.
"""

import json
import os
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np
import scipy.linalg
import scipy.sparse.linalg as sparse_linalg

try:
    from sksparse.cholmod import analyze, cholesky
except ImportError:
    analyze = cholesky = None

# On unit area, where the first positive eigenvalue is about 10.
SHIFT = -0.01
MOST_ITERATIONS = 200
BAND = 50
# A pair that is found twice is off by one; it would make up for one that is missed.
MOST_DEFECT = 1e-3


def factor(matrix, definite):
    """x ↦ matrix⁻¹ x, by CHOLMOD (LLᵀ by supernodes, or LDLᵀ where the matrix is indefinite), else by SuperLU in its symmetric mode."""
    if cholesky is not None:
        return cholesky(matrix.tocsc(), mode="supernodal" if definite else "simplicial")
    return symmetric_lu(matrix).solve


def refactor(pattern):
    """matrix ↦ (x ↦ matrix⁻¹ x) for indefinite matrices of one pattern, which is ordered and analysed once; SuperLU orders each anew."""
    if cholesky is not None:
        return analyze(pattern.tocsc(), mode="simplicial").cholesky
    return lambda matrix: factor(matrix, False)


def symmetric_lu(matrix):
    return sparse_linalg.splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def count_below(S, M, shift):
    """Eigenvalues below a shift, by the signs of the pivots; None where SuperLU left the diagonal, since signs prove nothing then."""
    if cholesky is not None:
        return int((cholesky((S - shift * M).tocsc(), mode="simplicial").D() < 0).sum())
    lu = symmetric_lu(S - shift * M)
    return int((lu.U.diagonal() < 0).sum()) if (lu.perm_r == lu.perm_c).all() else None


def residuals(S, M, values, vectors):
    """(4.6) for each pair; zero for the kernel of a Laplacian, whose S x is rounding."""
    image = S @ vectors
    off = np.linalg.norm(image - (M @ vectors) * values, axis=0)
    size = np.linalg.norm(image, axis=0)
    kernel = np.abs(values) < 1e-6
    return np.where(kernel, 0.0, off / np.where(kernel, 1.0, size))


def defect(M, vectors):
    """The largest entry of Vᵀ M V − I."""
    return np.abs(vectors.T @ (M @ vectors) - np.eye(vectors.shape[1])).max()


def shift_invert(S, M, count, shift, solve, tolerance, seed):
    operator = sparse_linalg.LinearOperator(S.shape, matvec=solve, dtype=float)
    start = np.random.default_rng(seed).uniform(-1, 1, S.shape[0])
    return sparse_linalg.eigsh(S, count, M, sigma=shift, OPinv=operator, tol=tolerance, v0=start)


def lanczos(S, M, count, tolerance, own):
    """ARPACK's implicitly restarted Lanczos, around a shift just below zero."""
    values, vectors = shift_invert(S, M, count, SHIFT, factor(S - SHIFT * M, True), own, 0)
    return values, vectors, None


def manifold_harmonics(S, M, count, tolerance, own):
    """The spectrum band by band, a factor for each (Vallet and Lévy 2008): of the pairs nearest to a shift those above the last band are new, and the next shift lies
    0.4 of the band's width above it. Where a band does not reach back to the last one, its shift is moved down half of the way, eight times at most. Factors of the
    bands above the first share one ordering."""
    values, vectors, last, shift, bands, again = np.zeros(0), np.zeros((S.shape[0], 0)), -np.inf, SHIFT, 0, None
    while len(values) < count:
        for attempt in range(8):
            if shift < 0:
                solve = factor(S - shift * M, True)
            else:
                again = again or refactor(S - shift * M)
                solve = again(S - shift * M)
            found, columns = shift_invert(S, M, BAND, shift, solve, own, bands)
            bands += 1
            if found.min() <= last or not len(values):
                break
            shift = last + 0.5 * (shift - last)
        order = np.argsort(found)
        found, columns = found[order], columns[:, order]
        new = found > last * (1 + 1e-6)
        values, vectors = np.concatenate([values, found[new]]), np.concatenate([vectors, columns[:, new]], axis=1)
        shift, last = found.max() + 0.4 * (found.max() - found.min()), found.max()
    return values[:count], vectors[:, :count], bands


def orthonormal(M, block, against=None):
    """An M-orthonormal basis of a block beside M-orthonormal columns; directions that are rounding are left out."""
    for _ in range(2):
        if against is not None:
            block = block - against @ (against.T @ (M @ block))
        gram = block.T @ (M @ block)
        scale = 1 / np.sqrt(np.maximum(gram.diagonal(), 1e-300))
        weights, turned = np.linalg.eigh(gram * np.outer(scale, scale))
        keep = weights > 1e-14 * weights[-1]
        block = block @ (scale[:, None] * turned[:, keep] / np.sqrt(weights[keep]))
    return block


def lobpcg(S, M, count, tolerance, own):
    """Knyazev's method over an orthonormal basis of [X W P] (Hetmaniuk and Lehoucq), which stops when the wanted pairs pass (4.6): SciPy's has one absolute tolerance
    for all columns, guards among them. The preconditioner is a factor of S + 0.01 M; converged columns are no longer corrected."""
    precondition = factor(S - SHIFT * M, True)
    size = count + max(5, count // 10)
    X = orthonormal(M, np.random.default_rng(0).standard_normal((S.shape[0], size)))
    values, turned = np.linalg.eigh(X.T @ (S @ X))
    X, P = X @ turned, X[:, :0]
    for iteration in range(MOST_ITERATIONS):
        SX, MX = S @ X, M @ X
        R = SX - MX * values
        relative = np.linalg.norm(R, axis=0) / np.maximum(np.linalg.norm(SX, axis=0), 1e-300)
        relative[np.abs(values) < 1e-6] = 0
        if (relative[:count] <= tolerance).all():
            break
        active = relative > 0.1 * tolerance
        before = np.concatenate([X, P], axis=1)
        W = orthonormal(M, precondition(R[:, active]), before)
        Q = np.concatenate([before, W], axis=1)
        values, C = scipy.linalg.eigh(Q.T @ (S @ Q), subset_by_index=[0, size - 1])
        # The part of the step that is not in X, orthonormal to the new X, by coefficients alone.
        D = C[:, active].copy()
        D[:size] = 0
        D -= C @ (C.T @ D)
        D -= C @ (C.T @ D)
        D = scipy.linalg.orth(D, rcond=1e-10)
        X, P = Q @ C, Q @ D
    return values[:count], X[:, :count], iteration


def inverse_power(S, M, count, tolerance, own):
    """Pair by pair, each to the tolerance and no further, orthogonal to those before (the thesis' Figure 6 d)."""
    solve = factor(S - SHIFT * M, True)
    random = np.random.default_rng(0)
    X, values, made = np.zeros((S.shape[0], 0)), [], 0
    for _ in range(count):
        x = random.standard_normal(S.shape[0])
        for iteration in range(10 * MOST_ITERATIONS):
            x = solve(M @ x)
            x -= X @ (X.T @ (M @ x))
            x /= np.sqrt(x @ (M @ x))
            value, made = x @ (S @ x), made + 1
            if iteration and residuals(S, M, np.array([value]), x[:, None])[0] <= tolerance:
                break
        X, values = np.column_stack([X, x]), [*values, value]
    return np.array(values), X, made


def missed(S, M, values):
    """How many eigenvalues lie below the widest gap of the last tenth of the values that are not among them."""
    first = max(1, len(values) - max(5, len(values) // 10))
    at = first + int(np.argmax(np.diff(values)[first - 1 :]))
    counted = count_below(S, M, 0.5 * (values[at - 1] + values[at]))
    return None if counted is None else counted - at


SOLVERS = {"lanczos": lanczos, "manifold_harmonics": manifold_harmonics, "lobpcg": lobpcg, "inverse_power": inverse_power}


def matrices(problem):
    """S and M of a problem on unit area, and the area."""
    import chladni

    mesh = chladni.Mesh.read(problem["mesh"], subdivide=problem["subdivide"])
    # Divided faces are of the mesh that is kept, not of the file.
    mesh = chladni.Mesh(mesh.kept_vertices, mesh.kept_faces)
    operator = problem["operator"]
    if operator.startswith("hamiltonian:"):
        operator = {"hamiltonian": {"potential": {"curvature": {"t": float(operator.partition(":")[2])}}}}
    S, M = mesh.laplacian(operator)
    keep = np.flatnonzero(M.diagonal() > 0)
    if problem["boundary"] == "dirichlet":
        corners = mesh.faces
        edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
        single, times = np.unique(edges, axis=0, return_counts=True)
        keep = np.setdiff1d(keep, single[times == 1].ravel())
    S, M = S.tocsr()[keep][:, keep], M.tocsr()[keep][:, keep]
    return S.tocsc(), (M / mesh.area).tocsc(), mesh.area


def run(problem):
    S, M, area = matrices(problem)
    solve = SOLVERS[problem["peer"]]
    # A tolerance of ARPACK is of another problem; the loosest is taken whose result passes the test and misses nothing. What passed and had missed some is told.
    passed = []
    ladder = [0] if problem["peer"] in ("lobpcg", "inverse_power") else [t for t in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10) if t <= problem["tolerance"]]
    for own in ladder:
        wall, processor = time.perf_counter(), time.process_time()
        values, vectors, iterations = solve(S, M, problem["count"], problem["tolerance"], own)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
        found, off = residuals(S, M, values, vectors), float(defect(M, vectors))
        answer = {
            "vertices": S.shape[0],
            "cpu": processor,
            "wall": wall,
            "iterations": iterations,
            "own_tolerance": own,
            "residual": float(found.max()),
            "residuals": found.tolist(),
            "defect": off,
            "converged": bool(found.max() <= problem["tolerance"] and off < MOST_DEFECT),
            "values": (values / area).tolist(),
            "missed": missed(S, M, values),
            "factor": "CHOLMOD" if cholesky else "SuperLU",
        }
        answer["passed_before"] = list(passed)
        print(json.dumps(answer), flush=True)
        if answer["converged"] and not answer["missed"]:
            break
        if answer["converged"]:
            passed.append([own, answer["missed"], processor])


if __name__ == "__main__":
    run(json.loads(sys.argv[1]))
