"""The `turnmill` command."""

import os

# Small matrices only: threads of the linear algebra library cost more than they give. Read when numpy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from turnmill_ros.cli.app import app, main

__all__ = ["app", "main"]
