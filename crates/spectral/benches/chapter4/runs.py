"""One solve after the other, ours and others', each in a process of its own; what was measured is kept in a file of JSON lines and not measured again."""

import dataclasses
import functools
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).parent


@dataclasses.dataclass(frozen=True)
class Problem:
    """The lowest pairs of an operator on a mesh of the folder, its faces divided so many times, to a residual (4.6)."""

    mesh: str
    count: int
    tolerance: float = 1e-2
    subdivide: int = 0
    operator: str = "laplace"
    boundary: str = "neumann"


class Runs:
    def __init__(self, program, meshes, record, limit, python, repeat=1):
        self.program, self.meshes, self.record, self.limit, self.python = program, pathlib.Path(meshes), record, limit, python
        self.repeat, self.known = repeat, {}
        if record and os.path.exists(record):
            with open(record) as file:
                for line in file:
                    key, answer = json.loads(line)
                    self.known[json.dumps(key, sort_keys=True)] = answer

    def path(self, mesh):
        here = self.meshes / mesh
        return str(here if here.exists() else mesh)

    def ours(self, problem, method="hsim", keep=None, **parameters):
        """A solve by the command line on one thread. `method`: hsim, sim, or published. `keep`: a file for the basis."""
        key = {**dataclasses.asdict(problem), "method": method, **parameters}
        if method == "published":
            method, parameters = "hsim", {"variant": "published", **parameters}
        command = [self.program, "solve", self.path(problem.mesh), "--method", method, "-n", str(problem.count), "--threads", "1", "--json"]
        command += ["--tolerance", repr(problem.tolerance), "--operator", problem.operator, "--boundary", problem.boundary]
        command += ["--subdivide", str(problem.subdivide)]
        for name, value in parameters.items():
            command += ["-p", f"{name}={value}"]
        # As the others store theirs.
        if keep or problem.tolerance < 1e-2:
            command += ["--precision", "f64"]
        if keep:
            command += ["--output", str(keep)]
        read = functools.partial(read_ours, tolerance=problem.tolerance)
        return self.measured(key, command, read, lambda: keep and not os.path.exists(keep))

    def peer(self, problem, peer):
        key = {**dataclasses.asdict(problem), "peer": peer}
        request = {**key, "mesh": self.path(problem.mesh)}
        command = [self.python, str(HERE / "peers.py"), json.dumps(request)]
        return self.measured(key, command, read_peer, lambda: False)

    def multilevel(self, problem, method, distance="dijkstra"):
        """Over the thesis' three levels in NumPy: `hsim`, or `mcs`, the multilevel correction scheme."""
        key = {**dataclasses.asdict(problem), "numpy": method, "distance": distance}
        request = {**dataclasses.asdict(problem), "mesh": self.path(problem.mesh), "method": method, "distance": distance, "program": self.program}
        command = [self.python, str(HERE / "multilevel.py"), json.dumps(request)]
        return self.measured(key, command, read_peer, lambda: False)

    def measured(self, key, command, read, missing):
        name = json.dumps(key, sort_keys=True)
        if name not in self.known or missing():
            answer = min((self.once(command, read) for _ in range(self.repeat)), key=lambda found: ("error" in found, found["cpu"]))
            self.known[name] = answer
            if self.record:
                with open(self.record, "a") as file:
                    file.write(json.dumps([key, answer]) + "\n")
            brief = {k: v for k, v in answer.items() if not isinstance(v, list) or len(v) < 8}
            print(name, brief, file=sys.stderr, flush=True)
        return self.known[name]

    def once(self, command, read):
        limit = int(self.limit)
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        answer = {"cpu": cpu, "wall": time.perf_counter() - start, "load": os.getloadavg()[0]}
        lines = done.stdout.strip().splitlines()
        if done.returncode in (-signal.SIGKILL, -signal.SIGXCPU) and cpu > 0.9 * limit:
            answer["error"] = f"not done in {limit} s"
        elif done.returncode != 0:
            answer["error"] = (done.stderr.strip().splitlines() or [f"ended by {done.returncode}"])[-1]
        if lines:
            answer.update(read(json.loads(lines[-1]), answer))
        return answer


def read_ours(result, answer, tolerance):
    stages = result["seconds"]["stages"]
    # On one thread a stage has the share of processor time that it has of the time.
    rate = answer["cpu"] / sum(stages.values())
    levels = result["certificate"]["levels"]
    return {
        "vertices": result["vertices"],
        "stages": {name: seconds * rate for name, seconds in stages.items()},
        "iterations": [level["iterations"] for level in levels],
        "dimensions": [level["dimension"] for level in levels],
        "shifts": [level["shifts"] for level in levels],
        "values": result["eigenvalues"],
        "residuals": result["residuals"],
        "residual": max(result["residuals"]),
        "converged": max(result["residuals"]) <= tolerance,
        "complete": result["certificate"]["complete"],
        "memory": result["peak_rss_bytes"],
    }


def read_peer(result, answer):
    return result


def iterations(answer):
    """As the thesis writes them: F for the coarsest level, then passes; passes alone where there is one level."""
    if "error" in answer:
        return "–"
    if len(answer["iterations"]) == 1:
        return str(answer["iterations"][0])
    return " ".join(["F"] + [str(passes) for passes in answer["iterations"][1:]])


def seconds(answer):
    """Processor seconds, or why there are none."""
    if "error" in answer and "not done" in answer["error"]:
        return "> " + answer["error"].split()[3] + " s"
    if "error" in answer:
        return "failed: " + answer["error"]
    text = short(answer["cpu"])
    if answer.get("converged") is False:
        text += f" (residual {answer['residual']:.0e}" + (f", off orthonormal by {answer['defect']:.0e})" if "defect" in answer else ")")
    if answer.get("complete") is False:
        text += " (not proven complete)"
    if answer.get("missed"):
        text += f" ({answer['missed']} missed)"
    for own, missed, cpu in answer.get("passed_before", ()):
        text += f" (at its {own:.0e} {short(cpu)}, {missed} missed)"
    return text


def short(x):
    return f"{x:.2f}" if x < 1 else f"{x:.1f}" if x < 20 else f"{x:.0f}"


def ratio(one, other):
    """How many times as long the first took."""
    if one is None or other is None or "error" in one or "error" in other:
        return "–"
    return short(one["cpu"] / other["cpu"])


def markdown(heads, rows):
    print("| " + " | ".join(heads) + " |")
    print("|" + "---|" * len(heads))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |", flush=True)
    print()
