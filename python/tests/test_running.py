"""How work runs: interrupted, watched, several at once, in processes that were forked."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import chladni

@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_ends_the_work_within_a_second(tmp_path):
    """Pairs that take minutes, interrupted in two stages. What is measured is processor time, of which a second has one from each core: the clock would tell
    how busy the machine is."""
    script = """
        import chladni, os, signal, time
        signal.signal(signal.SIGINT, signal.default_int_handler)
        mesh = chladni.Mesh.sample("knot", 100_000)
        for place in ("hierarchy", "iterate"):
            sent = []
            def watch(stage, fraction):
                if stage == place and not sent:
                    sent.append(time.process_time())
                    os.kill(os.getpid(), signal.SIGINT)
            try:
                chladni.eigs(mesh, k=500, method="hsim", progress=watch)
            except KeyboardInterrupt:
                print(place, time.process_time() - sent[0])
        print(len(chladni.eigs(chladni.Mesh.sample("sphere", 642), k=9)))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    *told, after = done.stdout.splitlines()
    assert [line.split()[0] for line in told] == ["hierarchy", "iterate"] and after == "9"
    assert all(float(line.split()[1]) < (os.cpu_count() or 1) for line in told), told


def test_an_exception_of_the_callback_ends_the_work():
    seen = []

    def watch(stage, fraction):
        seen.append((stage, fraction))
        if len(seen) == 3:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        chladni.eigs(chladni.Mesh.sample("knot", 60_000), k=1000, method="hsim", progress=watch)
    assert len(seen) == 3 and all(isinstance(stage, str) and 0 <= fraction <= 1 for stage, fraction in seen)


def test_progress_is_told_to_the_end(knot):
    seen = []
    chladni.eigs(knot, k=20, progress=lambda stage, fraction: seen.append((stage, fraction)))
    assert seen[-1] == ("done", 1.0)
    chladni.eigs(knot, k=5, progress=True)


def test_two_solves_at_once_and_the_interpreter_goes_on(knot, knot_basis):
    results, ticks = {}, 0
    other = chladni.Mesh.sample("torus", 4000)
    expected = chladni.eigs(other, k=30, method="hsim").values

    def solve(name, mesh, k):
        results[name] = chladni.eigs(mesh, k=k, method="hsim").values

    threads = [threading.Thread(target=solve, args=arguments) for arguments in [("knot", knot, 40), ("torus", other, 30)] * 2]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        ticks += 1
        time.sleep(0.001)
    assert np.array_equal(results["knot"], knot_basis.values) and np.array_equal(results["torus"], expected)
    assert ticks > 5, "the interpreter was locked while they ran"


def _solve_in_child(queue):
    queue.put(chladni.eigs(chladni.Mesh.sample("sphere", 642), k=9, method="hsim").values)


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_solves_too():
    here = chladni.eigs(chladni.Mesh.sample("sphere", 642), k=9, method="hsim").values
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_solve_in_child, args=(queue,), daemon=True)
    child.start()
    assert np.array_equal(queue.get(timeout=60), here)
    child.join(60)
    assert child.exitcode == 0


def test_threads_are_set(knot, knot_basis):
    before = chladni.get_threads()
    try:
        chladni.set_threads(1)
        assert chladni.get_threads() == 1
        assert np.allclose(chladni.eigs(knot, k=40, method="hsim").values, knot_basis.values, atol=1e-9)
    finally:
        chladni.set_threads(before)
    assert chladni.get_threads() == before


@pytest.mark.parametrize("count", [-1, 1.5, 100_000, "2", True, None])
def test_a_number_of_threads_that_there_cannot_be_is_refused(count):
    before = chladni.get_threads()
    with pytest.raises(chladni.ParameterError, match="^count must be "):
        chladni.set_threads(count)
    assert chladni.get_threads() == before


def test_nothing_but_the_public_names_is_imported(tmp_path):
    """SciPy and tqdm come with the first call that needs them."""
    script = "import sys, chladni; print(sorted(m for m in ('scipy', 'tqdm', 'torch') if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.strip() == "[]"
    assert sorted(chladni.__all__) == sorted({name for name in dir(chladni) if not name.startswith("_")} | {"__version__"})
    assert signal.getsignal(signal.SIGINT) is not None
