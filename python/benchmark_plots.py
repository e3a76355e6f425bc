"""Plots of seconds over vertices and over pairs beside SciPy, in one run and therefore on one machine, however busy: distances between lines are what counts.

    python benchmark_plots.py OUT.svg MESH [MESH ...] [--pairs 50 250] [--along MESH --counts 50 100 250 500 1000] [--most-seconds 120]

Processor seconds of one thread each. Chladni's pairs are proven complete with residuals of at most 1e-6, those of SciPy's `eigsh` have its tolerance 1e-6; both start at matrices that are assembled.
A solver that took more than --most-seconds is not asked for a larger problem. The figures are written beside the plots, as JSON. Needs matplotlib, and scikit-sparse for CHOLMOD.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib
import numpy as np
import scipy

import chladni
from benchmark import by_cholmod, by_superlu, timed

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: E402

TOLERANCE = 1e-6


def by_chladni(S, M, k, tol):
    """Proven pairs of the same matrices."""
    found = chladni.eigsh(S, k, M, tol=tol)
    assert found.complete
    return found


SOLVERS = {"chladni": by_chladni, "SciPy with CHOLMOD": by_cholmod, "SciPy with SuperLU": by_superlu}


class Course:
    """One solver along a series of problems of growing size."""

    def __init__(self, name, most):
        self.name, self.most, self.points = name, most, []

    def go(self, at, S, M, k):
        """Solves for `k` pairs unless the last problem took too long; `at` is where the point lies."""
        if self.points and self.points[-1][1] > self.most:
            return
        found, _, processor = timed(lambda: SOLVERS[self.name](S, M, k, TOLERANCE))
        if found is None:
            return
        self.points.append((at, processor))
        print(f"  {self.name}: {at}, {k} pairs: {processor:.2f} s", flush=True)


def pencil(path):
    """Stiffness and mass of a mesh of unit area."""
    mesh = chladni.Mesh.read(path)
    S, M = mesh.laplacian("laplace")
    return S, M / mesh.area


def draw(axes, title, label, courses):
    for course in courses:
        if course.points:
            axes.loglog(*zip(*course.points), marker="o", label=course.name)
    axes.set(title=title, xlabel=label, ylabel="processor seconds, one thread")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(frameon=False)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("meshes", type=Path, nargs="+")
    parser.add_argument("--pairs", type=int, nargs="+", default=[50, 250])
    parser.add_argument("--along", type=Path)
    parser.add_argument("--counts", type=int, nargs="+", default=[50, 100, 250, 500, 1000])
    parser.add_argument("--most-seconds", type=float, default=120.0)
    arguments = parser.parse_args()
    chladni.set_threads(1)
    courses = {k: [Course(name, arguments.most_seconds) for name in SOLVERS] for k in arguments.pairs}
    # In the order of their sizes, so that what took too long is not asked for more.
    pencils = sorted((pencil(path) for path in arguments.meshes), key=lambda pair: pair[0].shape[0])
    for S, M in pencils:
        for k, row in courses.items():
            for course in row:
                course.go(S.shape[0], S, M, k)
    plots = [(f"{k} pairs", "vertices", row) for k, row in courses.items()]
    if arguments.along:
        S, M = pencil(arguments.along)
        row = [Course(name, arguments.most_seconds) for name in SOLVERS]
        for k in sorted(arguments.counts):
            for course in row:
                course.go(k, S, M, k)
        plots.append((f"{arguments.along.stem}, {S.shape[0]:,} vertices", "pairs", row))
    figure, axes = plt.subplots(1, len(plots), figsize=(5 * len(plots), 4.2), squeeze=False, layout="constrained")
    for axis, (title, label, row) in zip(axes[0], plots):
        draw(axis, title, label, row)
    figure.savefig(arguments.out, metadata={"Date": None})
    told = {title: {course.name: course.points for course in row} for title, _, row in plots}
    told["versions"] = {"chladni": chladni.__version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    arguments.out.with_suffix(".json").write_text(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
