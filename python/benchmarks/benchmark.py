"""Figures of the package beside SciPy, in one run and therefore on one machine, however busy: ratios are what counts.

    python benchmark.py igea.ply POSES-FOLDER [--pairs 250] [--threads 1]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import scipy.sparse.linalg

import chladni


def timed(work):
    """The result of a call, seconds on the clock, and seconds of processors."""
    clock, processor = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - clock, time.process_time() - processor


def by_cholmod(S, M, k, tol):
    """Shift-invert with CHOLMOD, as LaPy can do it; None where scikit-sparse is not installed."""
    try:
        from sksparse.cholmod import cholesky
    except ImportError:
        return None
    shift = -0.01
    factor = cholesky((S - shift * M).tocsc())
    inverse = scipy.sparse.linalg.LinearOperator(S.shape, matvec=factor)
    return scipy.sparse.linalg.eigsh(S, k, M, sigma=shift, OPinv=inverse, tol=tol)


def by_superlu(S, M, k, tol):
    """Shift-invert as SciPy does it by itself."""
    return scipy.sparse.linalg.eigsh(S.tocsc(), k, M.tocsc(), sigma=-0.01, tol=tol)


def by_lapy(mesh, k):
    """LaPy as its users get it: its own linear elements, its default factorisation, its default tolerance; None where it is not installed."""
    try:
        import lapy
    except ImportError:
        return None
    return lapy.Solver(lapy.TriaMesh(mesh.vertices, mesh.faces)).eigs(k)


def pairs_of_one(path: Path, k: int) -> None:
    mesh = chladni.Mesh.read(path)
    S, M = mesh.laplacian("laplace")
    scale = mesh.area
    M = M / scale
    print(f"{path.name}: {S.shape[0]} vertices, {k} pairs, unit area")
    ours, seconds, processor = timed(lambda: chladni.eigs(mesh, k=k, method="hsim", tol=1e-9, operator="laplace"))
    print(f"  chladni.eigs, residuals 1e-9, complete: {ours.complete}: {seconds:.1f} s, {processor:.1f} s of processors")
    bare, seconds_bare, processor_bare = timed(lambda: chladni.eigsh(S, k, M, tol=1e-9))
    print(f"  chladni.eigsh, no geometry, complete: {bare.complete}: {seconds_bare:.1f} s, {processor_bare:.1f} s of processors")
    for name, solve in [("CHOLMOD", by_cholmod), ("SuperLU", by_superlu)]:
        found, clock, other = timed(lambda solve=solve: solve(S, M, k, 1e-9))
        if found is None:
            print(f"  eigsh with {name}: not installed")
            continue
        off = abs(found[0][1:] / scale - ours.values[1:]).max() / ours.values[-1]
        print(f"  eigsh with {name}, tol 1e-9: {clock:.1f} s, {other:.1f} s of processors: {clock / seconds:.1f} × the clock, "
              f"{other / processor:.1f} × the processors; values differ by {off:.0e}")
    found, clock, other = timed(lambda: by_lapy(mesh, k))
    if found is None:
        print("  LaPy: not installed")
    else:
        print(f"  LaPy's default: {clock:.1f} s, {other:.1f} s of processors: {clock / seconds:.1f} × the clock, {other / processor:.1f} × the processors")


def operators_of_many(folder: Path, k: int) -> None:
    paths = sorted(folder.glob("*.off"))
    meshes = [chladni.Mesh.read(path) for path in paths]
    _, seconds, processor = timed(lambda: [chladni.operators(mesh, k=k) for mesh in meshes])
    sizes = [len(mesh.vertices) for mesh in meshes]
    print(f"{len(meshes)} shapes of {min(sizes)} to {max(sizes)} vertices, {k} pairs with gradients: {len(meshes) / seconds:.2f} a second, "
          f"{processor / len(meshes):.2f} s of processors each")
    S, M = meshes[0].laplacian("laplace")
    _, clock, other = timed(lambda: by_superlu(S, M / meshes[0].area, k, 0))
    print(f"  eigsh with SuperLU, pairs alone: {clock:.2f} s, {other:.2f} s of processors")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=250)
    parser.add_argument("--threads", type=int, default=0)
    arguments = parser.parse_args()
    chladni.set_threads(arguments.threads)
    print(f"{chladni.get_threads()} threads, NumPy {np.__version__}, SciPy {scipy.__version__}")
    operators_of_many(arguments.folder, 128)
    pairs_of_one(arguments.mesh, arguments.pairs)
