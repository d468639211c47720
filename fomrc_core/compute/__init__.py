"""What computation needs and piezos do not: compiled kernels on or off, BLAS threads, least squares.

Nothing here knows what the numbers mean.
"""

__all__ = [
    "arrays",
    "blas_threads",
    "clustered_errors",
    "compile_lock",
    "compiled",
    "gauss_newton",
    "least_squares",
    "notebook",
    "pulse",
    "runs",
    "vector_registers",
    "work_tally",
]
