"""Imports matplotlib with any backend that the environment names.

Jupyter and Colab give every process that a notebook starts
``MPLBACKEND=module://matplotlib_inline.backend_inline``, and matplotlib refuses to be imported
with a backend that is not installed. Figures of this package are written to files and need none.
"""

import contextlib
import os

VARIABLE = "MPLBACKEND"


def import_matplotlib() -> None:
    """Import matplotlib; a backend that it knows stays chosen for other users of the process."""
    backend = os.environ.pop(VARIABLE, None)
    try:
        import matplotlib as mpl
    finally:
        if backend is not None:
            os.environ[VARIABLE] = backend
    if backend:
        with contextlib.suppress(ValueError):
            mpl.rcParams["backend"] = backend


import_matplotlib()
