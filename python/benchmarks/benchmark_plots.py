"""Plots of seconds over vertices and over pairs beside SciPy, in one run and therefore on one machine, however busy: distances between lines are what counts.

    python benchmark_plots.py OUT.svg MESH [MESH ...] [--pairs 50 250] [--along MESH --counts 50 100 250 500 1000] [--most-seconds 120]
    python benchmark_plots.py OUT.svg

The second line draws the figures beside OUT.svg again, without measuring anything; it needs matplotlib alone.

Processor seconds of one thread each. Chladni's pairs are proven complete with residuals of at most 1e-6, those of SciPy's `eigsh` have its tolerance 1e-6; both start at matrices that are assembled.
A solver that took more than --most-seconds is not asked for a larger problem. The figures are written beside the plots, as JSON. Needs matplotlib, and scikit-sparse for CHOLMOD.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: E402

# Letters stay text, which takes a fraction of their outlines, and names of clips do not change from run to run.
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "chladni"})

TOLERANCE = 1e-6


def by_chladni(S, M, k, tol):
    """Proven pairs of the same matrices."""
    import chladni

    found = chladni.eigsh(S, k, M, tol=tol)
    assert found.complete
    return found


def solvers():
    """Every solver by its name."""
    from benchmark import by_cholmod, by_superlu

    return {"chladni": by_chladni, "SciPy with CHOLMOD": by_cholmod, "SciPy with SuperLU": by_superlu}


class Course:
    """One solver along a series of problems of growing size."""

    def __init__(self, name, solver, most):
        self.name, self.solver, self.most, self.points = name, solver, most, []

    def go(self, at, S, M, k):
        """Solves for `k` pairs unless the last problem took too long; `at` is where the point lies."""
        from benchmark import timed

        if self.points and self.points[-1][1] > self.most:
            return
        found, _, processor = timed(lambda: self.solver(S, M, k, TOLERANCE))
        if found is None:
            return
        self.points.append((at, processor))
        print(f"  {self.name}: {at}, {k} pairs: {processor:.2f} s", flush=True)


def pencil(path):
    """Stiffness and mass of a mesh of unit area."""
    import chladni

    mesh = chladni.Mesh.read(path)
    S, M = mesh.laplacian("laplace")
    return S, M / mesh.area


def measure(arguments):
    """The points of each solver, by the titles of the plots, and the versions of what was measured."""
    import numpy as np
    import scipy

    import chladni

    chladni.set_threads(1)
    new = lambda: [Course(name, solver, arguments.most_seconds) for name, solver in solvers().items()]  # noqa: E731
    plots = {f"{k} pairs": (k, new()) for k in arguments.pairs}
    # In the order of their sizes, so that what took too long is not asked for more.
    for S, M in sorted((pencil(path) for path in arguments.meshes), key=lambda pair: pair[0].shape[0]):
        for k, row in plots.values():
            for course in row:
                course.go(S.shape[0], S, M, k)
    if arguments.along:
        S, M = pencil(arguments.along)
        row = new()
        for k in sorted(arguments.counts):
            for course in row:
                course.go(k, S, M, k)
        plots[f"{arguments.along.stem}, {S.shape[0]:,} vertices"] = (None, row)
    told = {title: {course.name: course.points for course in row} for title, (_, row) in plots.items()}
    told["versions"] = {"chladni": chladni.__version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    return told


def readable(axis, steps=(1, 2, 5)):
    """Plain numbers at these multiples of the powers of ten."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.10g}"))
    axis.set_minor_formatter(NullFormatter())


def draw(axes, title, courses):
    for name, points in courses.items():
        if points:
            axes.loglog(*zip(*points), marker="o", label=name)
    # What is fixed is in the title.
    label = "vertices" if title.endswith(" pairs") else "pairs"
    axes.set(title=title, xlabel=label, ylabel="processor seconds, one thread")
    readable(axes.xaxis)
    readable(axes.yaxis)
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(frameon=False)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("meshes", type=Path, nargs="*")
    parser.add_argument("--pairs", type=int, nargs="+", default=[50, 250])
    parser.add_argument("--along", type=Path)
    parser.add_argument("--counts", type=int, nargs="+", default=[50, 100, 250, 500, 1000])
    parser.add_argument("--most-seconds", type=float, default=120.0)
    arguments = parser.parse_args()
    figures = arguments.out.with_suffix(".json")
    if arguments.meshes:
        figures.write_text(json.dumps(measure(arguments), indent=1) + "\n")
    told = json.loads(figures.read_text())
    told.pop("versions", None)
    figure, axes = plt.subplots(1, len(told), figsize=(5 * len(told), 4.2), squeeze=False, layout="constrained")
    for axis, (title, courses) in zip(axes[0], told.items()):
        draw(axis, title, courses)
    figure.savefig(arguments.out, metadata={"Date": None})


if __name__ == "__main__":
    main()
