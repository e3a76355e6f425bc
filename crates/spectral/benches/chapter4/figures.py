"""The figures of chapter 4 as numbers, and as pictures where a folder is given."""

import os
import tempfile

import numpy as np

from flipped import flipped
from runs import Problem, markdown, seconds, short
from tables import EXPONENT, called, sphere
from thesis import TABLE6

INK = {"ours": "#1f4e79", "published": "#5b9bd5", "SIM": "#7f7f7f", "Lanczos": "#c55a11", "Manifold Harmonics": "#548235", "LOBPCG": "#7030a0"}


def figure5(runs, large, pictures=None):
    """Processor seconds over the number of pairs, Rocker Arm; in brackets milliseconds a pair."""
    subdivide = 2 if large else 1
    # How far each solver is taken, since the others' seconds grow too fast.
    solvers = {
        "ours": (runs.ours, "hsim", 5000),
        "published": (runs.ours, "published", 1000),
        "SIM": (runs.ours, "sim", 250),
        "Lanczos": (runs.peer, "lanczos", 250),
        "Manifold Harmonics": (runs.peer, "manifold_harmonics", 1000),
        "LOBPCG": (runs.peer, "lobpcg", 250),
    }
    counts = (50, 100, 250, 500, 1000, 2500, 5000) if large else (50, 100, 250, 500)
    thesis = {count: row[4] for count, row in TABLE6["Rocker Arm 270k"].items()}
    rows, curves = [], {name: [] for name in solvers}
    for count in counts:
        problem, row = Problem("rocker-arm.off", count, subdivide=subdivide), [count]
        for name, (run, method, most) in solvers.items():
            answer = run(problem, method) if count <= most else None
            row.append("–" if answer is None else f"{seconds(answer)}" + ("" if "error" in answer else f" ({short(1000 * answer['cpu'] / count)})"))
            if answer and "error" not in answer:
                curves[name].append((count, answer["cpu"]))
        row.append(f"{thesis[count]:g} ({short(1000 * thesis[count] / count)})" if count in thesis else "–")
        rows.append(row)
    markdown(["pairs", *solvers, "*thesis' HSIM, 270k*"], rows)
    draw(pictures, 5, [dict(title="Rocker Arm", curves=curves, x="pairs", y="processor seconds")])


def figure6(runs, large, pictures=None):
    """Relative difference to the eigenvalues l (l + 1) of the unit sphere, 100 pairs, by tolerance: median and largest."""
    exact = np.repeat([degree * (degree + 1) for degree in range(11)], [2 * degree + 1 for degree in range(11)])[:100]
    rows, panels = [], []
    for size in (10000, 100000, 1000000) if large else (10000, 100000):
        mesh, reference, curves = sphere(runs, size), None, {}
        for tolerance in (1e-6, 1e-4, 1e-2, 1e-1):
            answer = runs.ours(Problem(mesh, 100, tolerance))
            if "error" in answer:
                rows.append([size, EXPONENT[tolerance], seconds(answer), "–", "–"])
                continue
            values = np.array(answer["values"])[1:]
            off = np.abs(values - exact[1:]) / exact[1:]
            reference = values if tolerance == 1e-6 else reference
            moved = None if reference is None else np.abs(values - reference) / reference
            rows.append(
                [
                    answer["vertices"],
                    EXPONENT[tolerance],
                    f"{np.median(off):.2e}, {off.max():.2e}",
                    "–" if moved is None else f"{np.median(moved):.1e}, {moved.max():.1e}",
                    seconds(answer),
                ]
            )
            curves[EXPONENT[tolerance]] = list(zip(range(2, 101), off))
        panels.append(dict(title=f"sphere, {answer.get('vertices', size)} vertices", curves=curves, x="index", y="relative difference to l (l + 1)"))
    mesh = sphere(runs, 10000)
    reference = np.array(runs.ours(Problem(mesh, 100, 1e-6))["values"])[1:]
    for tolerance in (1e-4, 1e-2, 1e-1) if large else (1e-2, 1e-1):
        answer = runs.peer(Problem(mesh, 100, tolerance), "inverse_power")
        if "error" in answer:
            rows.append(["pair by pair", EXPONENT[tolerance], seconds(answer), "–", "–"])
            continue
        values = np.array(answer["values"])[1:]
        off, moved = (np.abs(values - true) / true for true in (exact[1:], reference))
        rows.append(
            [
                f"{answer['vertices']}, pair by pair",
                EXPONENT[tolerance],
                f"{np.median(off):.2e}, {off.max():.2e}",
                f"{np.median(moved):.1e}, {moved.max():.1e}",
                seconds(answer),
            ]
        )
    markdown(["vertices", "tolerance", "from l (l + 1)", "from those of 1e-6", "seconds"], rows)
    draw(pictures, 6, panels, logarithmic_x=False)


def figure7(runs, large, pictures=None):
    """What a tolerance of 1e-2 costs in accuracy, beside what another triangulation of the same vertices does: medians and largest of 100 pairs."""
    import chladni

    rows, panels = [], []
    for name in ("armadillo.obj", "igea.ply") if large else ("armadillo.obj",):
        mesh = chladni.Mesh.read(runs.path(name))
        vertices, faces = mesh.kept_vertices, mesh.kept_faces
        other, made = flipped(vertices, faces, 0.2, 0)
        folder = tempfile.gettempdir()
        paths = [os.path.join(folder, f"chapter4-{name.partition('.')[0]}-{kind}.npz") for kind in ("whole", "flipped")]
        for path, triangles in zip(paths, (faces, other)):
            np.savez(path, vertices=vertices, faces=triangles)
        bases = []
        for path, tolerance in ((paths[0], 1e-8), (paths[1], 1e-8), (paths[0], 1e-2)):
            kept = path.replace(".npz", f"-{EXPONENT[tolerance]}-basis.npz")
            answer = runs.ours(Problem(path, 100, tolerance), keep=kept)
            if "error" in answer:
                print(path, EXPONENT[tolerance], answer["error"])
                return
            bases.append(np.load(kept))
        exact, turned, loose = bases
        off = {}
        for kind, basis in (("other triangles, 1e-8", turned), ("1e-2, same triangles", loose)):
            values = np.abs(basis["eigenvalues"][1:] - exact["eigenvalues"][1:]) / exact["eigenvalues"][1:]
            one, two = exact["functions"][:, 1:], basis["functions"][:, 1:]
            mass = exact["mass"][:, None]
            sign = np.sign((mass * one * two).sum(axis=0))
            functions = np.sqrt((mass * (one - sign * two) ** 2).sum(axis=0))
            off[kind] = values, functions
            rows.append(
                [
                    f"{name.partition('.')[0]} {len(vertices) / 1000:.0f}k",
                    kind,
                    f"{np.median(values):.1e}, {values.max():.1e}",
                    f"{np.median(functions):.1e}, {functions.max():.1e}",
                ]
            )
        print(f"{name}: {made} of {len(faces) * 3 // 2} edges flipped.\n")
        for at, what in enumerate(("eigenvalues", "eigenfunctions, norm in L²")):
            panels.append(
                dict(title=what, curves={kind: list(zip(range(2, 101), pair[at])) for kind, pair in off.items()}, x="index", y="difference")
            )
    markdown(["mesh", "beside 1e-8 on the mesh", "eigenvalues, relative: median, largest", "eigenfunctions, L²: median, largest"], rows)
    draw(pictures, 7, panels, logarithmic_x=False)


def figure10(runs, large, pictures=None):
    """Iterations on the mesh, the residual they end with, and processor seconds, by tolerance; 50 pairs."""
    rows, panels = [], []
    solvers = {"ours": (runs.ours, "hsim"), "published": (runs.ours, "published"), "SIM": (runs.ours, "sim"), "LOBPCG": (runs.peer, "lobpcg")}
    for mesh, subdivide in (("rocker-arm.off", 1), ("armadillo.obj", 0)) if large else (("rocker-arm.off", 1),):
        curves = {name: [] for name in solvers}
        for tolerance in (1e-1, 1e-2, 1e-4, 1e-6, 1e-8) if large else (1e-2, 1e-4, 1e-6):
            problem, row = Problem(mesh, 50, tolerance, subdivide=subdivide), None
            for name, (run, method) in solvers.items():
                answer = run(problem, method)
                row = row or [called(problem, answer), EXPONENT[tolerance]]
                if "error" in answer:
                    row.append(seconds(answer))
                    continue
                passes = answer["iterations"] if name == "LOBPCG" else answer["iterations"][-1]
                row.append(f"{passes}; {answer['residual']:.0e}; {seconds(answer)}")
                curves[name].append((passes, answer["residual"]))
            rows.append(row)
        panels.append(dict(title=rows[-1][0], curves=curves, x="iterations on the mesh", y="largest residual"))
    markdown(["mesh", "tolerance", *solvers], rows)
    draw(pictures, 10, panels, logarithmic_x=False)


def figure11(runs, large, pictures=None):
    """Residuals (4.6) of the multilevel correction scheme and of HSIM over the same three levels, of ours and of the others: median and largest."""
    mesh, rows, panels = ("igea.ply" if large else "armadillo.obj"), [], []
    for count in (32, 250) if large else (32,):
        runs_of = {
            "multilevel correction": lambda problem: runs.multilevel(problem, "mcs"),
            "HSIM in NumPy": lambda problem: runs.multilevel(problem, "hsim"),
            "published": lambda problem: runs.ours(problem, "published", levels=3),
            "ours": lambda problem: runs.ours(problem),
            "SIM": lambda problem: runs.ours(problem, "sim"),
            "Lanczos": lambda problem: runs.peer(problem, "lanczos"),
            "Manifold Harmonics": lambda problem: runs.peer(problem, "manifold_harmonics"),
            "LOBPCG": lambda problem: runs.peer(problem, "lobpcg"),
        }
        curves = {}
        for name, run in runs_of.items():
            alone = name == "multilevel correction" or not large and name in ("SIM", "Lanczos", "Manifold Harmonics", "LOBPCG")
            for tolerance in (1e-2,) if alone else (1e-2, 1e-4):
                problem = Problem(mesh, count, tolerance)
                answer = run(problem)
                label = name if name == "multilevel correction" else f"{name}, {EXPONENT[tolerance]}"
                if "error" in answer:
                    rows.append([mesh, count, label, "–", "–", seconds(answer)])
                    continue
                found = np.array(answer["residuals"])[1:]
                rows.append([called(problem, answer), count, label, f"{np.median(found):.1e}", f"{found.max():.1e}", short(answer["cpu"] + answer.get("spaces", 0))])
                if name in ("multilevel correction", "HSIM in NumPy", "ours"):
                    curves[label] = list(zip(range(2, count + 1), found))
        panels.append(dict(title=f"{called(problem, answer)}, {count} pairs", curves=curves, x="index", y="residual"))
    markdown(["mesh", "pairs", "solver", "median", "largest", "seconds"], rows)
    draw(pictures, 11, panels, logarithmic_x=False)


def draw(folder, number, panels, logarithmic_x=True):
    """Curves of each panel, side by side."""
    if not folder:
        return
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "chladni", "font.size": 9, "font.family": "sans-serif"})
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(panels), figsize=(4.6 * len(panels), 3.4), squeeze=False, layout="constrained")
    for axis, panel in zip(axes[0], panels):
        for name, points in panel["curves"].items():
            if points:
                axis.plot(*zip(*points), label=name, color=INK.get(name), marker="o" if len(points) < 12 else None, markersize=3, linewidth=1.2)
        axis.set(title=panel["title"], xlabel=panel["x"], ylabel=panel["y"], yscale="log", xscale="log" if logarithmic_x else "linear")
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize=8)
    figure.savefig(os.path.join(folder, f"chapter-4-figure-{number}.svg"), metadata={"Date": None, "Creator": None})
