"""Judges what `campaign_exact --record FOLDER` wrote by SciPy's dense LAPACK: counts, values against their bounds, residuals, orthonormality; and whether a
tolerance that was refused for rounding could have been kept.

    python3 crates/spectral/benches/judge.py PROGRAM --solves 1000 --seed 1 [--multiple]

PROGRAM is the compiled bench; of the problems with multiple eigenvalues, those of more than 1,500 unknowns are left to its own judgement. It runs in batches, whose records are removed. Where a pencil is graded, low eigenvalues come from the inverse, M x = v (S + cM) x,
since LAPACK's errors are relative to the largest eigenvalue. Where an interval and LAPACK disagree, eigenvalues are counted in 60 digits, by mpmath.
Exits with 1 where an answer that is called complete is not.
"""

import argparse
import collections
import json
import pathlib
import subprocess
import sys
import tempfile

import mpmath
import numpy as np
import scipy.linalg

EPS = np.finfo(float).eps
SEEDS_PER_BATCH = 20
QUESTIONS = 4
MOST = 1500


def read(path):
    with open(path, "rb") as file:
        header = json.loads(file.readline())
        numbers = np.frombuffer(file.read(), dtype="<f8")
    at = 0

    def take(count):
        nonlocal at
        at += count
        return numbers[at - count : at]

    n = header["size"]
    matrices = []
    for entries in (header["stiffness"], header["mass"]):
        rows, columns, values = take(entries).astype(int), take(entries).astype(int), take(entries)
        matrix = np.zeros((n, n) if n <= MOST else (0, 0))
        if n <= MOST:
            matrix[rows, columns] = values
        matrices.append(matrix)
    m = header["pairs"] if header["outcome"] == "complete" else 0
    values, bounds = take(m), take(m)
    return header, matrices, values, bounds, take(n * m).reshape(m, n).T


def spectrum(stiffness, mass):
    """All eigenvalues, ascending, how far each may be off, and the vectors."""
    n = len(stiffness)
    lumped = mass.sum(1)
    stretch = 1.0 if np.count_nonzero(mass - np.diag(np.diag(mass))) == 0 else 4.0
    rows = np.abs(stiffness).sum(1)
    values, vectors = scipy.linalg.eigh(stiffness, mass)
    slack = np.full(n, 20 * EPS * stretch * (rows / lumped).max())
    shift = np.median(rows / lumped) / 4
    if values[0] < -10 * slack[0]:
        shift = max(shift, -2 * values[0])
    try:
        inverse, turned = scipy.linalg.eigh(-mass, stiffness + shift * mass)
    except np.linalg.LinAlgError:
        return values, slack, vectors
    with np.errstate(divide="ignore", invalid="ignore"):
        others = np.where(inverse < 0, -1 / inverse - shift, np.inf)
    least = max(others[0] + shift, shift * 1e-3)
    reach = 100 * EPS * stretch * (np.abs(others) + shift) ** 2 / least
    better = reach < slack
    values, slack = np.where(better, others, values), np.where(better, reach, slack)
    vectors = np.where(better, turned / np.sqrt(np.abs(np.einsum("ij,ij->j", turned, mass @ turned))), vectors)
    return values, slack, vectors


def counted(stiffness, mass, shift):
    """How many eigenvalues lie below a shift, a number of mpmath, by elimination in as many digits as it works with."""
    n, number = len(stiffness), mpmath.mpf
    rows = [
        {j: number(stiffness[i, j]) - shift * number(mass[i, j]) for j in np.flatnonzero((stiffness[i] != 0) | (mass[i] != 0))} for i in range(n)
    ]
    below = 0
    for i in range(n):
        pivot = rows[i].get(i, number(0))
        if pivot == 0:
            raise ZeroDivisionError(f"row {i} has no pivot at {shift}: what is counted here needs another order")
        below += pivot < 0
        for r in [r for r in rows[i] if r > i]:
            factor = rows[i][r] / pivot
            for c, value in rows[i].items():
                if c > i:
                    rows[r][c] = rows[r].get(c, number(0)) - factor * value
    return below


def outside(stiffness, mass, values, bounds, suspects):
    """The first of the suspects whose interval, by counts at its ends in 60 digits, does not hold the eigenvalue of its index."""
    with mpmath.workdps(60):
        for k in suspects:
            value, bound = mpmath.mpf(values[k]), mpmath.mpf(bounds[k])
            if not counted(stiffness, mass, value - bound) <= k < counted(stiffness, mass, value + bound):
                return k
    return None


def least_residual(stiffness, mass, value, x, shift):
    """The residual of the exact eigenvector, as it is when its entries are rounded to double precision."""
    long = lambda a: a.astype(np.longdouble)
    s, m, x = long(stiffness), long(mass), long(x)
    factor = scipy.linalg.cho_factor(stiffness + shift * mass)
    for _ in range(12):
        x = x / np.sqrt(x @ (m @ x))
        value = x @ (s @ x)
        r = s @ x - value * (m @ x)
        x = x - long(scipy.linalg.cho_solve(factor, r.astype(float)))
    x = long((x / np.sqrt(x @ (m @ x))).astype(float))
    image = s @ x
    value = (x @ image) / (x @ (m @ x))
    return float(np.linalg.norm(image - value * (m @ x)) / np.linalg.norm(image))


def judge(header, matrices, values, bounds, columns, tally, say):
    (stiffness, mass), n = matrices, header["size"]
    tally[header["outcome"]] += 1
    if n > MOST:
        tally["not judged: too large"] += 1
        if header["outcome"] != "complete":
            say(f"failed: {header['outcome']}")
        return
    exact, slack, vectors = spectrum(stiffness, mass)
    if header["outcome"] != "complete":
        if header["outcome"] == "tolerance-below-rounding":
            wanted = header["count"] or int(np.searchsorted(exact, header["below"]))
            # The smallest values have the largest residuals; of a kernel none is asked.
            clear = sorted((k for k in range(min(wanted, n)) if abs(exact[k]) > 10 * slack[k]), key=lambda k: abs(exact[k]))[:6]
            shift = max(np.abs(exact[clear]).max(), np.median(np.abs(exact))) if clear else 0
            shift = max(shift, -2 * exact[0])
            best = max((least_residual(stiffness, mass, exact[k], vectors[:, k], shift) for k in clear), default=np.inf)
            kind = "refused: rounding alone exceeds the tolerance" if best > header["tolerance"] else (
                "refused: rounding is within a tenth of it" if best > 0.1 * header["tolerance"] else "refused: it could have been kept")
            tally[kind] += 1
            if kind.endswith("kept"):
                say(f"{kind}: least {best:.1e}, floor {header['floor']:.1e}")
        else:
            say(f"failed: {header['outcome']}")
        return
    m = len(values)
    if header["count"] is not None:
        least = most = header["count"]
    else:
        # What the certificate names as lying on the bound may be on either side, if it does lie there.
        named = {int(index): (value, within) for index, value, within in header.get("on_bounds", [])}
        for index, (value, within) in named.items():
            if not max(abs(exact[index] - value), abs(header["below"] - value)) <= within + slack[index]:
                tally["false"] += 1
                say(f"FALSE: pair {index} is said to be {value!r} ± {within:.1e}, on the bound; it is {exact[index]!r}")
                return
        tally["with a pair on the bound, named"] += bool(named)
        clear = [index for index in range(n) if index not in named]
        least = int(np.sum((exact + slack)[clear] < header["below"]))
        most = int(np.sum((exact - slack)[clear] < header["below"])) + len(named)
    if not least <= m <= most:
        tally["false"] += 1
        say(f"FALSE: {m} pairs instead of {least} to {most}")
        return
    if m == 0:
        return
    gram = columns.T @ mass @ columns
    defect = np.abs(gram - np.eye(m)).max()
    image = stiffness @ columns
    residual = np.linalg.norm(image - mass @ columns * values, axis=0)
    norm = np.abs(stiffness).sum(1).max()
    floor = 100 * EPS * norm * np.linalg.norm(columns, axis=0)
    if not defect <= min(1e-7, 2 * header["defect"] + 1e-12):
        tally["false"] += 1
        say(f"FALSE: defect {defect:.1e}, not {header['defect']:.1e}")
    elif not np.all(residual <= 1.01 * header["tolerance"] * np.linalg.norm(image, axis=0) + floor):
        tally["false"] += 1
        say("FALSE: a residual is beyond the tolerance")
    error = np.abs(values - exact[:m])
    suspects = np.flatnonzero(error > bounds + slack[:m])
    if len(suspects):
        # LAPACK's own error is only estimated: who is right is counted.
        k = outside(stiffness, mass, values, bounds, suspects)
        tally["outside their bounds" if k is not None else "within their bounds by 60 digits, not by LAPACK"] += 1
        if k is not None:
            say(f"MISSED: value {k} of {m} is {values[k]!r}, not {exact[k]!r}: bound {bounds[k]:.1e}, LAPACK {slack[k]:.1e}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--solves", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--multiple", action="store_true")
    arguments = parser.parse_args()
    tally, judged, seed = collections.Counter(), 0, arguments.seed
    while judged < arguments.solves:
        with tempfile.TemporaryDirectory() as folder:
            solves = min(SEEDS_PER_BATCH * QUESTIONS, arguments.solves - judged)
            command = [arguments.program, "--solves", str(solves), "--seed", str(seed), "--record", folder]
            command += ["--multiple"] * arguments.multiple
            subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
            records = sorted(pathlib.Path(folder).iterdir(), key=lambda path: [int(part) for part in path.name.split(".")])
            if not records:
                sys.exit("the program wrote no records")
            for path in records:
                header, *rest = read(path)
                judge(header, *rest, tally, lambda text: print(f"{path.name} {header['name']}: {text}", flush=True))
            judged += len(records)
            seed = int(records[-1].name.split(".")[0]) + 1
    print(f"\n{judged} solves from seed {arguments.seed}")
    for kind, count in tally.most_common():
        print(f"{count:8} {kind}")
    sys.exit(1 if tally["false"] + tally["outside their bounds"] else 0)


if __name__ == "__main__":
    main()
