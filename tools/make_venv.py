"""Make .venv from nothing, or bring it up to date: libraries, messages, then turnmill itself (editable).

Run by the Makefile with any Python 3.11 or 3.12; needs only the standard library, a C and C++
compiler for the messages, and a package index. What is up to date is not touched: a file in .venv
holds the hashes of pyproject.toml, constraints.txt and the messages that were installed.

    python3 tools/make_venv.py [--dev]
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "installed.json"
WHEELS = VENV / "wheels"
MESSAGES = ROOT / "msg_schemas" / "turnmill_msgs"
CONSTRAINTS = ROOT / "constraints.txt"
PIP = [str(VENV / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "--quiet"]


def digest(*paths: Path) -> str:
    """One hash over the contents of files and folders."""
    total = hashlib.sha256(sys.version.encode())
    for path in paths:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in files:
            if "__pycache__" not in file.parts:
                total.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return total.hexdigest()


def toml(path: Path) -> dict:
    """A parsed TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def requirements(extras: list[str]) -> tuple[list[str], list[str]]:
    """What is to be installed, and what the two builds need besides."""
    project, messages = toml(ROOT / "pyproject.toml"), toml(MESSAGES / "pyproject.toml")
    install = [*project["project"]["dependencies"], *messages["project"]["dependencies"]]
    for extra in extras:
        install += project["project"]["optional-dependencies"][extra]
    build = [*project["build-system"]["requires"], "editables", *messages["build-system"]["requires"], "ninja"]
    build.append("cmake" + messages["tool"]["scikit-build"]["cmake"]["version"])
    return install, build


def run(arguments: list[str]) -> None:
    """Run a command; on failure end with its exit code."""
    code = subprocess.run(arguments, cwd=ROOT, check=False).returncode
    if code:
        sys.exit(f"make_venv: failed with exit code {code}: {' '.join(arguments[:8])} ...")


class Step:
    """Times a step and says so in one line."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __enter__(self) -> Step:
        print(f"  {self.name} ...", end="", flush=True)
        self.begin = time.monotonic()
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        if kind is None:
            print(f" {time.monotonic() - self.begin:.1f} s", flush=True)


def read_stamp() -> dict:
    """What is installed, empty where nothing is."""
    try:
        return json.loads(STAMP.read_text(encoding="utf-8"))
    except (FileNotFoundError, json.JSONDecodeError):
        return {}


def main() -> None:
    """Install what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dev", action="store_true", help="also what tests, checks and benchmarks need")
    extras = ["ros", "dev"] if parser.parse_args().dev else ["ros"]
    if not (3, 11) <= sys.version_info[:2] < (3, 13):
        sys.exit(f"make_venv: Python {sys.version.split()[0]} found, 3.11 or 3.12 wanted (make PYTHON=python3.12 ...)")

    wanted = {
        "python": sys.version,
        "libraries": digest(ROOT / "pyproject.toml", MESSAGES / "pyproject.toml", CONSTRAINTS),
        "messages": digest(MESSAGES),
    }
    found = read_stamp()
    if found.get("python") != wanted["python"]:
        found = {}
    extras = sorted(set(extras) | set(found.get("extras", [])))
    wanted["extras"] = extras
    if found == wanted:
        return
    if found.get("messages") != wanted["messages"] and not (shutil.which("cc") and shutil.which("c++")):
        sys.exit("make_venv: no C and C++ compiler (cc, c++) found; the ROS messages are compiled on this machine")

    print("Installing into .venv")
    begin = time.monotonic()
    if not found:
        with Step("making a virtual environment"):
            venv.EnvBuilder(clear=VENV.exists(), with_pip=True).create(VENV)
    STAMP.unlink(missing_ok=True)

    install, build = requirements(extras)
    with Step("downloading (the network's share)"):
        run([*PIP, "wheel", "--wheel-dir", str(WHEELS), "--constraint", str(CONSTRAINTS), *install, *build])
    size = sum(p.stat().st_size for p in WHEELS.iterdir()) / 1e6
    print(f"    {len(list(WHEELS.iterdir()))} packages, {size:.0f} MB")

    # From here on without the network; the isolated builds inherit both settings.
    os.environ |= {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": WHEELS.as_uri()}
    constrained = ["--constraint", str(CONSTRAINTS)]
    building = None
    if found.get("messages") != wanted["messages"]:
        building = subprocess.Popen([*PIP, "wheel", "--no-deps", "--wheel-dir", str(WHEELS), str(MESSAGES)], cwd=ROOT)
    with Step("installing libraries and turnmill"):
        run([*PIP, "install", *constrained, "--editable", f".[{','.join(extras)}]"])
    if building is not None:
        with Step("compiling the messages (began with the libraries)"):
            if building.wait():
                sys.exit(f"make_venv: the messages did not build (exit code {building.returncode})")
            run([*PIP, "install", *constrained, "--force-reinstall", "--no-deps", "turnmill_msgs"])
    shutil.rmtree(WHEELS)
    STAMP.write_text(json.dumps(wanted), encoding="utf-8")
    print(f"  ready after {time.monotonic() - begin:.1f} s")


if __name__ == "__main__":
    main()
