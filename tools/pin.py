"""Write constraints.txt: the newest versions that pyproject.toml allows, resolved by this Python.

Covers what is installed and what the builds need. Run it with 3.11 and with 3.12 and compare; test
before committing the outcome.

    .venv/bin/python tools/pin.py > constraints.txt
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from make_venv import ROOT, requirements

HEADER = """\
# The versions that were tested; the same on Python 3.11 and 3.12. Bounds are in pyproject.toml.
# Made by tools/pin.py: what is installed, and what building the packages and the messages needs."""


def main() -> None:
    """Resolve and print."""
    with tempfile.TemporaryDirectory() as folder:
        wanted = requirements(["ros", "dev"])
        command = [sys.executable, "-m", "pip", "--quiet", "wheel", "--wheel-dir", folder, *wanted]
        code = subprocess.run(command, cwd=ROOT, check=False, stdout=sys.stderr).returncode
        if code:
            sys.exit(code)
        names = {tuple(wheel.name.split("-")[:2]) for wheel in Path(folder).glob("*.whl")}
    print(HEADER)
    for name, version in sorted(names, key=lambda pin: pin[0].lower()):
        print(f"{name.replace('_', '-')}=={version}")


if __name__ == "__main__":
    main()
