"""The thesis' three-level hierarchy in NumPy, with other distances than the program's published variant has, and the multilevel correction scheme over it.

    python3 multilevel.py '{"mesh": "armadillo.obj", …, "method": "hsim", "distance": "stvd", "program": "target/release/chladni"}'

prints one line of JSON. Prolongations (4.11) of each distance come from the program's radial construction, which has the same linear functions around the same samples
and hands them out. Their rows are normalised again, since they are stored in single precision.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

from peers import factor, matrices, residuals  # first of all: it sets the number of threads

import numpy as np
import scipy.linalg
import scipy.sparse as sparse

SIGMA = 7
RATIO = 0.1
MOST_ITERATIONS = 60
DISTANCES = {"dijkstra": "dijkstra", "stvd": '{"stvd":{"window":3}}', "fast_marching": "fast_marching"}


def prolongation(problem, distance, dimension):
    """U from so many farthest points to the mesh, and the seconds of sampling and of its columns. (A basis of 50 pairs is kept as U and coefficients, one of few as columns.)"""
    name = os.path.basename(problem["mesh"]).partition(".")[0]
    kept = os.path.join(tempfile.gettempdir(), f"chapter4-{name}-{problem['subdivide']}-{distance}-{dimension}.npz")
    told = kept + ".json"
    if not os.path.exists(told):
        command = [problem["program"], "solve", problem["mesh"], "--subdivide", str(problem["subdivide"]), "--operator", "laplace"]
        command += ["--method", "approximate", "--construction", "radial", "-n", "50", "-d", str(dimension), "--threads", "1", "--json", "-o", kept]
        for parameter in (f"distance={DISTANCES[distance]}", "profile=linear", "sampling=farthest_points", f"sigma={SIGMA}"):
            command += ["-p", "radial." + parameter]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        with open(told, "w") as file:
            file.write(output)
    with open(told) as file:
        stages = json.load(file)["seconds"]["stages"]
    file = np.load(kept)
    U = sparse.csr_matrix((file["data"].astype(float), file["indices"], file["indptr"]), shape=tuple(file["shape"]))
    return U, stages["sampling"] + stages["basis"]


def normalised(U):
    return (sparse.diags(1 / np.asarray(U.sum(axis=1)).ravel()) @ U).tocsr()


def hierarchy(problem, distance, n):
    """U⁰ and U¹ of (4.12), finest first, for the sizes of (4.7) and (4.9), and the seconds they took."""
    coarsest = max(1000, int(np.ceil(1.5 * problem["count"])))
    middle = int(np.sqrt(coarsest * n))
    (fine, first), (coarse, second) = (prolongation(problem, distance, size) for size in (middle, coarsest))
    # A column is largest at its sample; samples of the coarser level are among those of the finer.
    samples = np.asarray(fine.argmax(axis=0)).ravel()
    inner = coarse[samples]
    return [normalised(fine), normalised(inner[:, inner.getnnz(axis=0) > 0])], first + second


def galerkin(S, M, spaces):
    levels = [(S, M)]
    for U in spaces:
        levels.append(tuple((U.T @ A @ U).tocsc() for A in levels[-1]))
    return levels


def ritz(S, M, X):
    values, turned = scipy.linalg.eigh(X.T @ (S @ X), X.T @ (M @ X))
    return values, X @ turned


def subspace_iteration(S, M, X, count, tolerance, shift):
    """Algorithm 1, two inverse iterations between one Ritz step and the next."""
    solve = factor(S - shift * M, False)
    done = 0
    for iteration in range(1, MOST_ITERATIONS + 1):
        Y = X[:, done:]
        for _ in range(2):
            Y = solve(M @ Y)
            Y = Y / np.sqrt(np.einsum("ij,ij->j", Y, M @ Y))
        values, X = ritz(S, M, np.concatenate([X[:, :done], Y], axis=1))
        found = residuals(S, M, values[:count], X[:, :count])
        if (found <= tolerance).all():
            break
        open_pairs = np.flatnonzero(found > 0.1 * tolerance)
        done = int(open_pairs[0])
    return values, X, iteration


def shift_at(values, count):
    """Algorithm 3, line 12, moved to the middle between two Ritz values, since an eigenvalue itself makes no factor."""
    at = max(2, int(RATIO * count))
    return 0.5 * (values[at - 1] + values[at])


def hsim(levels, spaces, count, tolerance):
    """Algorithm 3. Iterations a level, the coarser first."""
    q = max(int(np.ceil(1.5 * count)), count + 8)
    S, M = levels[-1]
    values, X = scipy.linalg.eigh(S.toarray(), M.toarray(), subset_by_index=[0, q - 1])
    passes = []
    for (S, M), U in zip(levels[-2::-1], spaces[::-1]):
        values, X, made = subspace_iteration(S, M, U @ X, count, tolerance, shift_at(values, count))
        passes.append(made)
    return values[:count], X[:, :count], passes


def correction(levels, spaces, count):
    """The multilevel correction scheme (Lin and Xie): on every finer level one linear problem a pair, and the eigenproblem of the coarsest space with their solutions in it.
    The form is S + M, since S alone is singular."""
    S, M = coarse = levels[-1]
    values, X = scipy.linalg.eigh(S.toarray(), M.toarray(), subset_by_index=[0, count - 1])
    coarse = [A.toarray() for A in coarse]
    down = sparse.identity(S.shape[0], format="csr")
    for (S, M), U in zip(levels[-2::-1], spaces[::-1]):
        down = (U @ down).tocsr()
        X = factor(S + M, True)((M @ (U @ X)) * (values + 1))
        # In terms of the coarsest space and what is not in it.
        image = down.T @ (M @ X)
        X = X - down @ np.linalg.solve(coarse[1], image)
        X = X / np.sqrt(np.einsum("ij,ij->j", X, M @ X))
        inside = []
        for A, small in zip((S, M), coarse):
            mixed = down.T @ (A @ X)
            inside.append(np.block([[small, mixed], [mixed.T, X.T @ (A @ X)]]))
        values, turned = scipy.linalg.eigh(*inside, subset_by_index=[0, count - 1])
        X = down @ turned[: down.shape[1]] + X @ turned[down.shape[1] :]
    return values, X, []


def run(problem):
    S, M, area = matrices(problem)
    spaces, built = hierarchy(problem, problem["distance"], S.shape[0])
    wall, processor = time.perf_counter(), time.process_time()
    levels = galerkin(S, M, spaces)
    restricted = time.process_time() - processor
    if problem["method"] == "hsim":
        values, X, passes = hsim(levels, spaces, problem["count"], problem["tolerance"])
    else:
        values, X, passes = correction(levels, spaces, problem["count"])
    processor, wall = time.process_time() - processor, time.perf_counter() - wall
    found = residuals(S, M, values, X)
    answer = {
        "vertices": S.shape[0],
        "dimensions": [level[0].shape[0] for level in levels[::-1]],
        "cpu": processor,
        "wall": wall,
        "spaces": built,
        "restricted": restricted,
        "iterations": [0, *passes],
        "values": (values / area).tolist(),
        "residuals": found.tolist(),
        "residual": float(found.max()),
        "converged": bool(found.max() <= problem["tolerance"]),
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    run(json.loads(sys.argv[1]))
