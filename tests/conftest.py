"""Shared fixtures: an isolated ROS graph per worker and test, and the folder of recordings."""

from __future__ import annotations

import itertools
import os
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples in every run, and no clock; `pytest --hypothesis-profile=search` looks for new ones.
settings.register_profile("seeded", deadline=None, derandomize=True, database=None)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile("seeded")

DOMAINS = 102  # ROS_DOMAIN_ID 0 to 101: ports below the ephemeral range on every platform
WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
# Two runs on one machine should not meet: begin at a place that depends on the run.
RUN = zlib.crc32(os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid())).encode())


def _domains() -> Iterator[int]:
    """Domain ids of this worker: no other worker of this run gets the same."""
    for k in itertools.count():
        yield (RUN + WORKER + WORKERS * (k % (DOMAINS // WORKERS))) % DOMAINS


_DOMAINS = _domains()
os.environ["ROS_DOMAIN_ID"] = str(next(_DOMAINS))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ.pop("ROS_STATIC_PEERS", None)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads that spin take the cores from the graph


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """A fresh ROS domain for this test; set in os.environ, so that child processes inherit it."""
    domain = next(_DOMAINS)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    return domain


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[object]:
    """An initialised rclpy context of its own, in a fresh domain; shut down at the end."""
    rclpy = pytest.importorskip("rclpy")
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


@pytest.fixture(scope="session")
def project() -> Path:
    """Root folder of the project."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder with recordings of real machines; skips where TURNMILL_RECORDINGS is unset."""
    folder = os.environ.get("TURNMILL_RECORDINGS")
    if not folder:
        pytest.skip("TURNMILL_RECORDINGS is not set: no recordings of real machines here")
    path = Path(folder)
    if not path.is_dir():
        pytest.fail(f"TURNMILL_RECORDINGS names {path}, which is not a folder")
    return path
