"""The tables of chapter 4, ours beside the thesis'."""

import os
import subprocess
import tempfile

from runs import Problem, iterations, markdown, ratio, seconds, short
from thesis import RATIOS, SIGMAS, TABLE2, TABLE3, TABLE4, TABLE4A1, TABLE4A3, TABLE5, TABLE6

PEERS = ("lanczos", "manifold_harmonics", "lobpcg")
EXPONENT = {1e-1: "1e-1", 1e-2: "1e-2", 1e-4: "1e-4", 1e-6: "1e-6", 1e-8: "1e-8"}


def called(problem, answer):
    """The mesh with its vertices in thousands."""
    name = problem.mesh.rpartition("/")[2].partition(".")[0]
    if name.startswith("chapter4-"):
        name = name.split("-")[1]
    return f"{name} {answer['vertices'] / 1000:.0f}k" if "vertices" in answer else f"{name}, divided {problem.subdivide} times"


def check(runs, large):
    """Whether all solvers have the same problem: largest relative difference of their values from ours, 40 pairs at 1e-8."""
    rows = []
    for mesh, operator, boundary in (
        ("rocker-arm.off", "laplace", "neumann"),
        ("rocker-arm.off", "hamiltonian:0.1", "neumann"),
        ("face.obj", "laplace", "dirichlet"),
    ):
        problem = Problem(mesh, 40, 1e-8, operator=operator, boundary=boundary)
        ours = runs.ours(problem)
        row = [called(problem, ours), operator, boundary]
        for answer in [runs.ours(problem, "sim")] + [runs.peer(problem, peer) for peer in PEERS]:
            off = [abs(a - b) / abs(a) for a, b in zip(ours["values"], answer.get("values", ())) if abs(a) > 1e-6 * ours["values"][-1]]
            row.append(f"{max(off):.0e}" if off else seconds(answer))
        rows.append(row)
    markdown(["mesh", "operator", "boundary", "SIM", "Lanczos", "Manifold Harmonics", "LOBPCG"], rows)


def table2(runs, large):
    """Iterations and processor seconds by levels."""
    cases = [
        ("Rocker Arm 270k", (Problem("rocker-arm.off", 50, subdivide=1), Problem("rocker-arm.off", 50, 1e-4, subdivide=1))),
        ("Rocker Arm 270k", (Problem("rocker-arm.off", 250, subdivide=1),)),
    ]
    if large:
        cases = [
            ("Rocker Arm 270k", [Problem("rocker-arm.off", count, tolerance, subdivide=2) for count in (50, 2000) for tolerance in (1e-2, 1e-4)]),
            ("Ramses 820k", [Problem("igea.ply", count, subdivide=1) for count in (50, 300)]),
        ]
    rows = []
    for model, problems in cases:
        for problem in problems:
            found = [runs.ours(problem, "published", levels=levels) for levels in (2, 3, 4, 5)]
            ours = runs.ours(problem)
            count = problem.count if (problem.count, problem.tolerance) in TABLE2[model] else 2000
            thesis = TABLE2[model][count, problem.tolerance]
            row = [called(problem, ours), problem.count, EXPONENT[problem.tolerance]]
            row += [f"{iterations(answer)}: {seconds(answer)}" for answer in found]
            row += [f"{len(ours['iterations'])} levels: {seconds(ours)}"]
            rows.append(row)
            best = min(seconds for _, seconds in thesis.values())
            rows.append(
                [f"*thesis, {model}*", count, EXPONENT[problem.tolerance]] + [f"{i}: {t:g}" for i, t in thesis.values()] + [f"least {best:g}"]
            )
    markdown(["mesh", "pairs", "tolerance", "2 levels", "3 levels", "4 levels", "5 levels", "ours"], rows)


def table3(runs, large):
    """Iterations and processor seconds by σ, the overlap of the prolongations."""
    cases = [("Vase-Lion 200k", "armadillo.obj", 0, (100,))]
    if large:
        cases = [("Vase-Lion 200k", "igea.ply", 0, (100, 400, 750)), ("Eros 475k", "igea.ply", 1, (100, 400, 750))]
    rows = []
    for model, mesh, subdivide, counts in cases:
        for count in counts:
            problem = Problem(mesh, count, subdivide=subdivide)
            # The program takes σ from 3 on.
            found = [runs.ours(problem, "published", sigma=sigma) if sigma >= 3 else None for sigma in SIGMAS]
            ours = runs.ours(problem)
            cells = [f"{iterations(answer)}: {seconds(answer)}" if answer else "refused" for answer in found]
            rows.append([called(problem, ours), count, *cells, seconds(ours)])
            rows.append([f"*thesis, {model}*", count] + [f"{i}: {t:g}" for i, t in TABLE3[model][count]] + ["–"])
    markdown(["mesh", "pairs"] + [f"σ = {sigma:g}" for sigma in SIGMAS] + ["ours"], rows)


def table4(runs, large):
    """Iterations by the place of the shift."""
    mesh, rows = ("igea.ply" if large else "armadillo.obj"), []
    for tolerance in (1e-2, 1e-4):
        for levels in (2, 3, 4):
            problem = Problem(mesh, 50, tolerance)
            found = [runs.ours(problem, "published", levels=levels, shift_ratio=share) for share in RATIOS]
            thesis = TABLE4[tolerance, levels]
            rows.append([EXPONENT[tolerance], levels] + [f"{iterations(answer)} ({text})" for answer, text in zip(found, thesis)])
    print(f"{called(problem, found[0])}; in brackets the thesis, Gargoyle 85k.\n")
    markdown(["tolerance", "levels"] + [f"{share:.3g}" for share in RATIOS], rows)


def split(answer):
    """Iterations; hierarchy, solve (with the certificate, where there is one) and their sum."""
    if "error" in answer:
        return ["–", "–", "–", seconds(answer)]
    stages = answer["stages"]
    rest = stages.get("iterate", 0) + stages.get("certify", 0)
    return [iterations(answer), short(stages["hierarchy"]), short(rest), short(stages["hierarchy"] + rest)]


def table5(runs, large):
    """Boundary conditions, and other solvers beside."""
    rows = []
    for (boundary, count), thesis in TABLE5.items():
        problem = Problem("face.obj", count, subdivide=2 if large else 1, boundary=boundary)
        rows.append([f"*thesis, Julius Caesar 370k, {boundary}*", count, "HSIM", *thesis])
        for name, method in (("published", "published"), ("ours", "hsim"), ("SIM", "sim")):
            answer = runs.ours(problem, method)
            rows.append([f"{called(problem, answer)}, {boundary}", count, name, *split(answer)])
        for peer in PEERS if large or count == 50 else ():
            answer = runs.peer(problem, peer)
            # Of Manifold Harmonics they would be its bands.
            passes = answer.get("iterations", "–") if peer == "lobpcg" else "–"
            rows.append([f"{called(problem, answer)}, {boundary}", count, peer.replace("_", " "), passes, "–", "–", seconds(answer)])
    markdown(["mesh, boundary", "pairs", "solver", "iterations", "hierarchy", "solve", "total"], rows)


def table6(runs, large, counts=(50, 250)):
    """HSIM beside SIM, Lanczos, Manifold Harmonics and LOBPCG; ratios to ours, and the thesis' to its own HSIM."""
    cases = [("Rocker Arm 270k", "rocker-arm.off", 1), ("Sphere 160k", sphere(runs, 10000), 0), ("Rolling stage 660k", "rolling-stage.obj", 0)]
    if large:
        cases = [("Rocker Arm 270k", "rocker-arm.off", 2), ("Sphere 160k", sphere(runs, 160000), 0), ("Rolling stage 660k", "rolling-stage.obj", 2)]
        counts = (50, 250, 1000)
    rows = []
    for model, mesh, subdivide in cases:
        for count in counts if large or mesh != "rolling-stage.obj" else (50,):
            problem = Problem(mesh, count, subdivide=subdivide)
            ours, published, sim = (runs.ours(problem, method) for method in ("hsim", "published", "sim"))
            others = [runs.peer(problem, peer) for peer in PEERS]
            passes, slow, _, levels, hsim, matlab, bands, spectra, block = TABLE6[model][count]
            rows.append(
                [called(problem, ours), count, seconds(ours)]
                + [f"{seconds(answer)} · {ratio(answer, ours)} ×" for answer in (published, sim, *others)]
            )
            rows.append(
                [
                    f"*thesis, {model}*",
                    count,
                    "–",
                    f"{hsim:g}",
                    f"{slow:g} · {slow / hsim:.1f} ×",
                    f"{min(matlab, spectra):g} · {min(matlab, spectra) / hsim:.1f} ×",
                ]
                + [f"{bands:g} · {bands / hsim:.1f} ×", f"{block:g} · {block / hsim:.1f} ×" if block else "out of memory"]
            )
            print(
                f"{called(problem, ours)}, {count} pairs: iterations on the mesh: ours {ours['iterations'][-1:]}, published "
                f"{iterations(published)} (thesis {levels}), SIM {sim.get('iterations')} (thesis {passes}), LOBPCG {others[2].get('iterations')}\n"
            )
    markdown(["mesh", "pairs", "ours", "published", "SIM", "Lanczos", "Manifold Harmonics", "LOBPCG"], rows)


def table4a1(runs, large):
    """Distances of the prolongations. The program has Dijkstra's alone for the published variant; the others are measured in NumPy, over the program's functions."""
    cases = [("Gargoyle 85k", "armadillo.obj", 0)]
    numpy = ("Dijkstra", "STVD", "fast marching") if large else ("Dijkstra", "STVD")
    if large:
        cases += [("Fertility 270k", "igea.ply", 0), ("Oil-pump 570k", "igea.ply", 1)]
    rows = []
    for model, mesh, subdivide in cases:
        for tolerance in (1e-2, 1e-4):
            problem = Problem(mesh, 100, tolerance, subdivide=subdivide)
            for name, method, parameters in (("Dijkstra", "published", {"levels": 3}), ("none: ours", "hsim", {})):
                answer = runs.ours(problem, method, **parameters)
                rows.append([called(problem, answer), name, EXPONENT[tolerance], *split(answer)])
            for name in numpy if mesh == "armadillo.obj" else ():
                answer = runs.multilevel(problem, "hsim", name.lower().replace(" ", "_"))
                if "error" in answer:
                    rows.append([called(problem, answer), f"{name}, NumPy", EXPONENT[tolerance], "–", "–", "–", seconds(answer)])
                    continue
                built, solved = answer["spaces"] + answer["restricted"], answer["cpu"] - answer["restricted"]
                rows.append(
                    [
                        called(problem, answer),
                        f"{name}, NumPy",
                        EXPONENT[tolerance],
                        iterations(answer),
                        short(built),
                        short(solved),
                        short(built + solved),
                    ]
                )
            for name in ("Dijkstra", "STVD", "heat"):
                passes, hierarchy, solve = TABLE4A1[model][name, tolerance]
                rows.append([f"*thesis, {model}*", name, EXPONENT[tolerance], passes, hierarchy, solve, f"{hierarchy + solve:.1f}"])
    markdown(["mesh", "distance", "tolerance", "iterations", "hierarchy", "solve", "total"], rows)


def table4a3(runs, large):
    """Hamiltonians t (κ₁² + κ₂²) beside the Laplacian."""
    cases = [("Cube 25k", "bumpy-cube.obj", 0, (50, 250)), ("Blade 200k", "igea.ply", 0, (50,))]
    if large:
        cases = [
            ("Cube 25k", "bumpy-cube.obj", 0, (50, 250, 1000)),
            ("Blade 200k", "igea.ply", 0, (50, 250, 1000)),
            ("Bimba 500k", "igea.ply", 1, (50, 250, 1000)),
        ]
    rows = []
    for model, mesh, subdivide, counts in cases:
        for count in counts:
            for method in ("published", "hsim"):
                row = None
                for operator in ("laplace", "hamiltonian:0.1", "hamiltonian:1"):
                    problem = Problem(mesh, count, subdivide=subdivide, operator=operator)
                    answer = runs.ours(problem, method)
                    row = row or [called(problem, answer), count, "ours" if method == "hsim" else method]
                    passes, hierarchy, solve, total = split(answer)
                    row.append(f"{hierarchy} + {solve} = {total}; {passes}")
                rows.append(row)
            thesis = [f"{h:g} + {s:g} = {h + s:.1f}; {i}" for h, s, i in TABLE4A3[model][count]]
            rows.append([f"*thesis, {model}*", count, "HSIM", *thesis])
    markdown(["mesh", "pairs", "solver", "Laplacian", "Hamiltonian, t = 0.1", "Hamiltonian, t = 1"], rows)


def sphere(runs, vertices):
    """A regular unit sphere, written once to the folder for temporary files."""
    path = os.path.join(tempfile.gettempdir(), f"chapter4-sphere-{vertices}.ply")
    if not os.path.exists(path):
        subprocess.run([runs.program, "sample", "sphere", "-n", str(vertices), "-o", path], check=True, stdout=subprocess.DEVNULL)
    return path
