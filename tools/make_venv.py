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


def digest(*parts: object) -> str:
    """One hash over values and over the contents of folders."""
    total = hashlib.sha256()
    for part in parts:
        if isinstance(part, Path):
            for file in sorted(p for p in part.rglob("*") if p.is_file() and "__pycache__" not in p.parts):
                total.update(str(file.relative_to(part)).encode() + file.read_bytes())
        else:
            total.update(json.dumps(part, sort_keys=True).encode())
    return total.hexdigest()


def toml(folder: Path) -> dict:
    """The parsed pyproject.toml of a folder."""
    return tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))


def requirements(extras: list[str], base: bool = True, messages: bool = True) -> list[str]:
    """What to download: for the extras, for the base, for the messages, and what the builds need besides."""
    project, interface = toml(ROOT), toml(MESSAGES)
    wanted = [*project["build-system"]["requires"], "editables"]
    for extra in extras:
        wanted += project["project"]["optional-dependencies"][extra]
    if base:
        wanted += project["project"]["dependencies"]
    if messages:
        wanted += interface["project"]["dependencies"] + interface["build-system"]["requires"]
        wanted += ["ninja", "cmake" + interface["tool"]["scikit-build"]["cmake"]["version"]]
    return wanted


def run(arguments: list[str]) -> None:
    """Run a command; on failure end with its exit code."""
    code = subprocess.run(arguments, cwd=ROOT, check=False).returncode
    if code:
        sys.exit(f"make_venv: failed with exit code {code}: {' '.join(arguments[:8])} ...")


class Step:
    """Times a step and says so in one line."""

    def __init__(self, name: str) -> None:
        self.name, self.outcome = name, ""

    def __enter__(self) -> Step:
        self.begin = time.monotonic()
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        if kind is None:
            print(f"  {self.name}: {time.monotonic() - self.begin:.1f} s{self.outcome}", flush=True)


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

    project = toml(ROOT)
    wanted = {
        "python": sys.version,
        "libraries": digest(project["project"], project["build-system"], CONSTRAINTS.read_text(encoding="utf-8")),
        "messages": digest(MESSAGES),
    }
    found = read_stamp()
    if found.get("python") != wanted["python"]:
        found = {}
    wanted["extras"] = sorted({*extras, *found.get("extras", [])})
    if found == wanted:
        return
    install(found, wanted)


def install(found: dict, wanted: dict) -> None:
    """Install what differs between what was found and what is wanted."""
    base = found.get("libraries") != wanted["libraries"]
    messages = found.get("messages") != wanted["messages"]
    extras = [e for e in wanted["extras"] if base or e not in found["extras"]]
    if messages and not (shutil.which("cc") and shutil.which("c++")):
        sys.exit("make_venv: no C and C++ compiler (cc, c++) found; the ROS messages are compiled on this machine")

    print("Installing into .venv", flush=True)
    begin = time.monotonic()
    if not found:
        with Step("virtual environment"):
            venv.EnvBuilder(clear=VENV.exists(), with_pip=True).create(VENV)
    STAMP.unlink(missing_ok=True)
    constrained = ["--constraint", str(CONSTRAINTS)]
    with Step("download (the network's share)") as step:
        run([*PIP, "wheel", "--wheel-dir", str(WHEELS), *constrained, *requirements(extras, base, messages)])
        size = sum(p.stat().st_size for p in WHEELS.iterdir()) / 1e6
        step.outcome = f" for {len(list(WHEELS.iterdir()))} packages, {size:.0f} MB"

    # From here on without the network; isolated builds inherit both settings.
    os.environ |= {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": WHEELS.as_uri()}
    build = [*PIP, "wheel", "--no-deps", "--wheel-dir", str(WHEELS), str(MESSAGES)]
    building = subprocess.Popen(build, cwd=ROOT) if messages else None
    try:
        with Step("libraries and turnmill"):
            every = ",".join(wanted["extras"])
            run([*PIP, "install", "--no-compile", *constrained, "--editable", f".[{every}]"])
        if building:
            with Step("messages (compiled meanwhile)"):
                if building.wait():
                    sys.exit(f"make_venv: the messages did not build (exit code {building.returncode})")
                run([*PIP, "install", *constrained, "--force-reinstall", "--no-deps", "turnmill_msgs"])
    finally:
        if building and building.poll() is None:
            building.terminate()
            building.wait()
    shutil.rmtree(WHEELS)
    STAMP.write_text(json.dumps(wanted), encoding="utf-8")
    print(f"  ready after {time.monotonic() - begin:.1f} s", flush=True)


if __name__ == "__main__":
    main()
