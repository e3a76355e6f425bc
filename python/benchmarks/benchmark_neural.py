"""The chart that neural eigensolvers are shown by: seconds over vertices for the lowest 96 eigenfunctions, beside ARPACK, and the span loss of each.

    python benchmark_neural.py OUT.svg MESH [MESH ...] [--count 96] [--threads 2] [--runs 2] [--subdivide] [--most-vertices 200000]
    python benchmark_neural.py OUT.svg

The second line draws the figures beside OUT.svg again, without measuring anything; it needs matplotlib alone.

Seconds on the clock, the least of --runs. Chladni begins at vertices and faces, so that its operator is included; ARPACK, by SciPy's `eigsh` with SuperLU and with CHOLMOD, begins at matrices
that are assembled. ARPACK with SuperLU is asked for meshes of up to --most-vertices. The span loss of a basis is the mean over the exact eigenfunctions of 1 - |P f|², where P projects
onto the span in the norm of the mass; exact ones are those of ARPACK where it ran, and else Chladni's, proven complete. --subdivide adds the largest
mesh once more with every face cut into four. The figures are written beside the plot, as JSON.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmark_plots import plt, readable

OURS = {
    "approximate": {"method": "approximate"},
    "approximate, accurate": {"method": "approximate", "accuracy": "accurate"},
    "hsim, complete": {"method": "hsim", "tol": 1e-2},
}


def least(runs, work):
    """The result of the last call, and the least seconds of all."""
    from benchmark import timed

    taken = [timed(work)[:2] for _ in range(runs)]
    return taken[-1][0], min(seconds for _, seconds in taken)


def span_loss(exact, basis, M):
    """Of each exact function the share that no combination of the basis has; both have columns of unit norm, orthogonal in the mass."""
    import numpy as np

    return 1 - np.square(basis.T @ (M @ exact)).sum(axis=0)


def measure(arguments):
    import numpy as np
    import scipy

    import chladni
    from benchmark import by_cholmod, by_superlu

    chladni.set_threads(arguments.threads)
    meshes = sorted((chladni.Mesh.read(path) for path in arguments.meshes), key=lambda mesh: len(mesh.vertices))
    if arguments.subdivide:
        finer = chladni.Mesh(meshes[-1].vertices, meshes[-1].faces, subdivide=1)
        # A mesh of its own: functions on one that was subdivided have the rows of the vertices that were given.
        meshes.append(chladni.Mesh(finer.kept_vertices, finer.kept_faces))
    rows = []
    for mesh in meshes:
        S, M = mesh.laplacian("laplace")
        S, M = S.tocsc(), (M / mesh.area).tocsc()
        n, k = S.shape[0], arguments.count
        row = {"vertices": n, "seconds": {}, "span_loss": {}}
        vectors = {}
        for name, how in OURS.items():
            found, row["seconds"][name] = least(arguments.runs, lambda how=how: chladni.eigs(mesh, k=k, operator="laplace", **how))
            vectors[name] = np.asarray(found.vectors) * np.sqrt(mesh.area)
            print(f"{n} vertices, {name}: {row['seconds'][name]:.2f} s", flush=True)
        for name, solve in [("ARPACK, CHOLMOD", by_cholmod), ("ARPACK, SuperLU", by_superlu)]:
            if name.endswith("SuperLU") and n > arguments.most_vertices:
                continue
            found, seconds = least(arguments.runs, lambda solve=solve: solve(S, M, k, 1e-10))
            if found is not None:
                row["seconds"][name], vectors[name] = seconds, found[1]
                print(f"{n} vertices, {name}: {seconds:.2f} s", flush=True)
        row["exact"] = next((name for name in vectors if name.startswith("ARPACK")), "hsim, complete")
        exact = vectors[row["exact"]]
        for name in OURS:
            loss = span_loss(exact, vectors[name], M)
            row["span_loss"][name] = [float(loss.mean()), float(loss.max())]
            print(f"{n} vertices, {name}: span loss {loss.mean():.1e}, at most {loss.max():.1e}", flush=True)
        rows.append(row)
    versions = {"chladni": chladni.__version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    return {"count": arguments.count, "threads": arguments.threads, "rows": rows, "versions": versions}


def draw(told, out):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    rows = told["rows"]
    for axes, what, label in [(left, "seconds", f"seconds, {told['threads']} thread{'s' * (told['threads'] > 1)}"), (right, "span_loss", "span loss, mean and largest")]:
        for name in dict.fromkeys(name for row in rows for name in row[what]):
            points = [(row["vertices"], row[what][name]) for row in rows if name in row[what]]
            at, values = zip(*points)
            if what == "seconds":
                axes.loglog(at, values, marker="o", label=name)
            else:
                (line,) = axes.loglog(at, [mean for mean, _ in values], marker="o", label=name)
                axes.loglog(at, [most for _, most in values], marker="^", linestyle=":", color=line.get_color())
        axes.set(title=f"{told['count']} eigenfunctions", xlabel="vertices", ylabel=label)
        axes.grid(True, which="both", alpha=0.25)
        readable(axes.xaxis, steps=(1,))
        axes.legend(frameon=False)
    readable(left.yaxis)
    # What neural eigensolvers report on theirs: Yang, Du and Liu 2026, Learning Laplacian Eigenspace with Mass-Aware Neural Operators on Point Clouds.
    right.axhline(3.35e-3, color="grey", linestyle="--", linewidth=1)
    right.annotate("mean of a neural eigensolver (NEO)", (1, 3.35e-3), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize="small", color="grey")
    figure.savefig(out, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("meshes", type=Path, nargs="*")
    parser.add_argument("--count", type=int, default=96)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--subdivide", action="store_true")
    parser.add_argument("--most-vertices", type=int, default=200_000)
    arguments = parser.parse_args()
    figures = arguments.out.with_suffix(".json")
    if arguments.meshes:
        figures.write_text(json.dumps(measure(arguments), indent=1) + "\n")
    draw(json.loads(figures.read_text()), arguments.out)


if __name__ == "__main__":
    main()
