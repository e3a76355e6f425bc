"""Seconds that cuSOLVER takes for all pairs of a dense symmetric-definite problem of size d in f64: the least of two runs after a first
one, Cholesky and both triangular solves included, and the way to the card and back. Prints one number; fails where neither torch nor CuPy finds
a card.

    python3 benches/gpu_cusolver.py 2000
"""

import sys
import time

import numpy as np


def with_torch(a, b):
    import torch

    if not torch.cuda.is_available():
        raise RuntimeError("torch finds no card")
    a, b = torch.from_numpy(a).cuda(), torch.from_numpy(b).cuda()
    factor = torch.linalg.cholesky(b)
    half = torch.linalg.solve_triangular(factor, a, upper=False)
    standard = torch.linalg.solve_triangular(factor, half.T.contiguous(), upper=False)
    values, vectors = torch.linalg.eigh((standard + standard.T) / 2)
    vectors = torch.linalg.solve_triangular(factor.T, vectors, upper=True)
    return values.cpu().numpy(), vectors.cpu().numpy()


def with_cupy(a, b):
    import cupy
    import cupyx.scipy.linalg as linalg

    a, b = cupy.asarray(a), cupy.asarray(b)
    factor = cupy.linalg.cholesky(b)
    half = linalg.solve_triangular(factor, a, lower=True)
    standard = linalg.solve_triangular(factor, half.T, lower=True)
    values, vectors = cupy.linalg.eigh((standard + standard.T) / 2)
    vectors = linalg.solve_triangular(factor.T, vectors, lower=False)
    return cupy.asnumpy(values), cupy.asnumpy(vectors)


def main():
    d = int(sys.argv[1])
    random = np.random.default_rng(d)
    a = random.standard_normal((d, d))
    a = a + a.T
    apart = np.abs(np.subtract.outer(np.arange(d), np.arange(d)))
    b = np.where(apart == 0, 1.0, 0.15 / np.maximum(apart, 1) ** 2)
    for solve in (with_torch, with_cupy):
        try:
            solve(a[:64, :64].copy(), b[:64, :64].copy())
        except (ImportError, RuntimeError):
            continue
        seconds = []
        for _ in range(3):
            began = time.perf_counter()
            solve(a, b)
            seconds.append(time.perf_counter() - began)
        print(f"{min(seconds[1:]):.2f}")
        return
    sys.exit("neither torch nor CuPy finds a card")


main()
