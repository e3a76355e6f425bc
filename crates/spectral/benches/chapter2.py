"""Tables and figures of the thesis' chapter 2 from the command line `chladni`, as `docs/chapter-2.md` shows them.

    python3 crates/spectral/benches/chapter2.py table1 --program target/release/chladni --meshes FOLDER

`table1`: seconds of each step. `table3`: of the construction, by the distance. `figure6`: errors of eigenvalues by the dimension. `figure7`: how far approximate
eigenfunctions reach over exact ones, and what exact ones lose in their span (figure 8). `figure9`: Shape-DNA of a collection. `figure11`: what coordinates lose in the first of 5,000 pairs, and filters by
these (figure 12). `--large` takes what needs minutes or more. NumPy and SciPy are needed for all figures but `figure6`.
"""

import argparse
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

# Vertices, dimension, pairs; operator, sampling, adjacency and basis, restriction, eigen, all.
THESIS = [
    ("Chinese Dragon", "127k", 1000, 500, 0.42, 0.11, 0.46, 0.23, 1.39, 2.61),
    ("Neptune", "2003k", 1000, 500, 4.34, 4.65, 7.11, 3.30, 1.31, 20.70),
    ("Chinese Dragon", "127k", 5000, 2500, 0.42, 0.13, 0.66, 0.23, 52.18, 53.62),
    ("Chinese Dragon", "127k", 10000, 5000, 0.43, 0.17, 1.00, 0.25, 421.86, 423.71),
    ("Neptune", "2003k", 10000, 5000, 4.53, 2.88, 18.38, 3.47, 434.36, 463.64),
]


class Bench:
    def __init__(self, arguments):
        self.arguments = arguments

    def solve(self, mesh, *more, output=None):
        path = pathlib.Path(self.arguments.meshes) / mesh
        command = [self.arguments.program, "solve", str(path), "--threads", str(self.arguments.threads), "--json", *more]
        if output:
            command += ["--output", str(output)]
        processor = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        before = processor()
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")
        return {**json.loads(done.stdout), "processor": processor() - before}

    def approximate(self, mesh, count, dimension, construction="radial", *more, output=None):
        flags = ["--method", "approximate", "--construction", construction, "--count", str(count), "--dimension", str(dimension)]
        # What may be needed where functions are added until a goal is met, several times what is, is not waited for.
        flags.append("--ignore-memory")
        return self.solve(mesh, *flags, *more, output=output)

    def exact(self, mesh, count, tolerance="1e-6", output=None):
        return self.solve(mesh, "--method", "hsim", "--count", str(count), "--tolerance", tolerance, output=output)


def table1(bench):
    """Table 2.1."""
    large = bench.arguments.large
    print("| mesh | vertices | d | pairs | operator | sampling | basis | reduce | eigen | these | bounds | processor, all |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for name, vertices, dimension, pairs, *steps in THESIS:
        cells = [f"{step:.2f}" for step in steps]
        print(f"| *thesis, {name}* | {vertices} | {dimension} | {pairs} | " + " | ".join(cells) + " | – | – |")
    for mesh in bench.arguments.mesh or ["igea.ply"]:
        for dimension, pairs in [(1000, 500), (5000, 2500), (10000, 5000)][1 if large else 0 : 3 if large else 1]:
            for construction in ["radial", "heat"]:
                found = bench.approximate(mesh, pairs, dimension, construction)
                steps = found["seconds"]["stages"]
                own = [sum(steps.get(part, 0.0) for part in parts) for parts in (["operator"], ["sampling"], ["basis", "columns"], ["reduce"], ["eigen"])]
                cells = [f"{step:.2f}" for step in [*own, sum(own), steps.get("bounds", 0.0), found["processor"]]]
                # Rounds add functions until the goal is met.
                print(f"| {mesh}, `{construction}` | {found['vertices']:,} | {found['dimension']:,} | {pairs:,} | " + " | ".join(cells) + " |", flush=True)


def table3(bench):
    """Table 2.3."""
    print("| distance | basis | errors of 500 eigenvalues, mean / largest |")
    print("|---|---|---|")
    mesh = (bench.arguments.mesh or ["igea.ply"])[0]
    exact = bench.exact(mesh, 500, "1e-4")["eigenvalues"]
    for name, distance, thesis in [
        ("Dijkstra", "dijkstra", 2.72),
        ("Euclidean", "euclidean", 2.73),
        ("STVD, window 3", {"stvd": {"window": 3}}, 7.07),
        ("STVD, window 6", {"stvd": {"window": 6}}, 14.66),
        ("fast marching", "fast_marching", None),
    ]:
        radial = json.dumps({"distance": distance})
        found = bench.approximate(mesh, 500, 1000, "radial", "-p", f"radial={radial}")
        seconds = found["seconds"]["stages"]["basis"]
        errors = [100 * (own / true - 1) for own, true in zip(found["eigenvalues"][1:], exact[1:])]
        theirs = f" (thesis {thesis})" if thesis else ""
        print(f"| {name} | {seconds:.2f}{theirs} | {sum(errors) / len(errors):.2f} / {max(errors):.2f} % |", flush=True)


def figure6(bench):
    """Figure 2.6."""
    mesh = (bench.arguments.mesh or ["armadillo.obj"])[0]
    count = 1000 if bench.arguments.large else 500
    exact = bench.exact(mesh, count, "1e-4")["eigenvalues"]
    places = [count // 10, count // 4, count // 2, count]
    print("| construction | d | " + " | ".join(f"pair {place}" for place in places) + " | mean |")
    print("|---" * (len(places) + 3) + "|")
    for construction in ["radial", "heat"]:
        for dimension in [2 * count, 5 * count][: 2 if bench.arguments.large else 1]:
            found = bench.approximate(mesh, count, dimension, construction)["eigenvalues"]
            errors = [100 * (own / true - 1) for own, true in zip(found[1:], exact[1:])]
            cells = [f"{errors[place - 2]:.2f} %" for place in places]
            print(f"| `{construction}` | {dimension} | " + " | ".join(cells) + f" | {sum(errors) / len(errors):.2f} % |", flush=True)


def functions(path):
    """Eigenfunctions as a dense matrix, eigenvalues and masses."""
    import numpy
    import scipy.sparse

    content = numpy.load(path)
    if "coefficients" in content:
        size = tuple(content["shape"])
        space = scipy.sparse.csr_matrix((content["data"], content["indices"], content["indptr"]), shape=size)
        lifted = space.astype(float) @ content["coefficients"]
    else:
        lifted = content["functions"].astype(float)
    return lifted, content["eigenvalues"], content["mass"]


def figure7(bench):
    """Figures 2.7 and 2.8."""
    import numpy

    mesh = (bench.arguments.mesh or ["kitten.obj"])[0]
    count = 500
    with tempfile.TemporaryDirectory() as folder:
        exact = pathlib.Path(folder) / "exact.npz"
        bench.exact(mesh, count, output=exact)
        reference, _, mass = functions(exact)
        print("| construction | function | largest coefficient | half of it within ± | exact, what their span loses | approximate, what the exact span loses |")
        print("|---|---|---|---|---|---|")
        for construction in ["radial", "heat"]:
            other = pathlib.Path(folder) / f"{construction}.npz"
            bench.approximate(mesh, count, 1000, construction, output=other)
            own = functions(other)[0]
            coefficients = reference.T @ (mass[:, None] * own)
            lost = numpy.sqrt(numpy.maximum(1 - (coefficients**2).sum(axis=1), 0))
            beyond = numpy.sqrt(numpy.maximum(1 - (coefficients**2).sum(axis=0), 0))
            for place in [10, 50, 100, 200, 400]:
                squares = coefficients[:, place - 1] ** 2
                around = numpy.argsort(abs(numpy.arange(count) - (place - 1)), kind="stable")
                within = abs(around[numpy.searchsorted(numpy.cumsum(squares[around]), 0.5 * squares.sum())] - (place - 1))
                print(
                    f"| `{construction}` | {place} | {numpy.sqrt(squares.max()):.3f} | {within} | {100 * lost[place - 1]:.2f} % | {100 * beyond[place - 1]:.2f} % |",
                    flush=True,
                )


def figure9(bench):
    """Figure 2.9: Shape-DNA of poses, approximate beside exact."""
    import numpy

    folder = pathlib.Path(bench.arguments.meshes)
    names = sorted(str(path.relative_to(folder)) for path in folder.glob("poses/*.off"))

    def described(solve):
        spectra = []
        for name in names:
            found = solve(name)
            spectra.append(numpy.array(found["eigenvalues"][1:101]) * area(folder / name) / numpy.arange(1, 101))
        return numpy.array(spectra)

    exact = described(lambda name: bench.exact(name, 101, "1e-4"))
    distances = lambda of: numpy.linalg.norm(of[:, None] - of[None], axis=2)
    kinds = numpy.array([pathlib.Path(name).stem.rstrip("0123456789") for name in names])
    same = kinds[:, None] == kinds[None]
    off = ~numpy.eye(len(names), dtype=bool)
    print("| spectra | within a kind, mean / largest | between kinds, least | nearest is of the same kind | distances off, mean |")
    print("|---|---|---|---|---|")
    true = distances(exact)
    for title, of in [("exact", exact)] + [
        (f"`{construction}`, d = 250", described(lambda name: bench.approximate(name, 101, 250, construction))) for construction in ["radial", "heat"]
    ]:
        found = distances(of)
        nearest = numpy.argmin(numpy.where(off, found, numpy.inf), axis=1)
        inside, outside = found[same & off], found[~same]
        wrong = abs(found - true)[off].mean() / true[off].mean()
        print(
            f"| {title} | {inside.mean():.2f} / {inside.max():.2f} | {outside.min():.2f} | {sum(kinds[nearest] == kinds)} of {len(names)} | {100 * wrong:.1f} % |",
            flush=True,
        )


def figure11(bench):
    """Figures 2.11 and 2.12: coordinates in the first of 5,000 pairs, and filters by all of them."""
    import time

    import numpy
    import scipy.sparse

    name = (bench.arguments.mesh or ["armadillo.obj"])[0]
    pairs = 5000 if bench.arguments.large else 500
    places = [pairs // 100, pairs // 10, pairs // 2, pairs]
    print("| construction | seconds of the basis | " + " | ".join(f"{place} pairs lose" for place in places) + " | projecting | low pass | sharpened | filter, seconds |")
    print("|---" * (len(places) + 6) + "|")
    smooth = {}
    with tempfile.TemporaryDirectory() as folder:
        for construction in ["heat", "radial"]:
            path = pathlib.Path(folder) / f"{construction}.npz"
            found = bench.approximate(name, pairs, 2 * pairs, construction, "-p", "seed=1", output=path)
            content = numpy.load(path)
            space = scipy.sparse.csr_matrix((content["data"], content["indices"], content["indptr"]), shape=tuple(content["shape"])).astype(float)
            own, values, mass = content["coefficients"], content["eigenvalues"], content["mass"]
            points = positions(pathlib.Path(bench.arguments.meshes) / name, content)
            points -= (mass[:, None] * points).sum(axis=0) / mass.sum()
            size = lambda x: numpy.sqrt((mass[:, None] * x * x).sum())
            begin = time.perf_counter()
            coefficients = own.T @ (space.T @ (mass[:, None] * points))
            projecting = time.perf_counter() - begin
            back = lambda factors: space @ (own @ (factors[:, None] * coefficients))
            lost = [size(points - back((numpy.arange(pairs) < place).astype(float))) / size(points) for place in places]
            begin = time.perf_counter()
            smooth[construction] = [back(numpy.exp(-values / values[pairs // 10]))]
            filtering = time.perf_counter() - begin
            # What the pairs do not hold is as much stronger as the last of them.
            gain = 1 + 1.5 * values / (values + values[pairs // 4])
            smooth[construction].append(back(gain) + 2.5 * (points - back(numpy.ones(pairs))))
            # How far the surfaces of one construction are from those of the other.
            first = smooth["heat"]
            off = [f"{100 * size(a - b) / size(points):.3f} %" if construction != "heat" else "–" for a, b in zip(smooth[construction], first)]
            cells = [f"{100 * loss:.3f} %" for loss in lost] + [f"{projecting:.2f}", *off, f"{filtering:.2f}"]
            print(f"| `{construction}` | {found['seconds']['total']:.1f} | " + " | ".join(cells) + " |", flush=True)


def positions(path, content):
    """Of the kept vertices of an OBJ file."""
    import numpy

    rows = [line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")]
    points, places = numpy.array(rows, float), content["vertex_map"] if "vertex_map" in content else numpy.arange(len(rows))
    kept = numpy.empty((content["mass"].size, 3))
    kept[places[places >= 0]] = points[places >= 0]
    return kept


def area(path):
    """Of an OFF file of triangles."""
    import numpy

    words = path.read_text().split()
    vertices, faces = int(words[1]), int(words[2])
    points = numpy.array(words[4 : 4 + 3 * vertices], float).reshape(-1, 3)
    corners = numpy.array(words[4 + 3 * vertices : 4 + 3 * vertices + 4 * faces], int).reshape(-1, 4)[:, 1:]
    a, b, c = (points[corners[:, k]] for k in range(3))
    return 0.5 * numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).sum()


def main():
    parts = {"table1": table1, "table3": table3, "figure6": figure6, "figure7": figure7, "figure9": figure9, "figure11": figure11}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=parts)
    parser.add_argument("--program", default="target/release/chladni")
    parser.add_argument("--meshes", required=True)
    parser.add_argument("--mesh", action="append", help="instead of the usual one; table1 takes several")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--large", action="store_true")
    arguments = parser.parse_args()
    parts[arguments.part](Bench(arguments))


if __name__ == "__main__":
    main()
