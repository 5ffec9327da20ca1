"""The full counts: every test with the slow ones, and docs/validation.md written anew.

Run: make verify (takes long). `--table-only` writes the table without running the tests.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
PAGE = ROOT / "docs" / "validation.md"
HEAD = """# Validation: published beside computed

Written by `make verify`; do not edit. Every published number that the model can be asked for stands here
beside what it computes, with the reason where they differ. No number was fitted but where a row says so. Sources:
A. Comak, *Mechanics, Dynamics and Stability of Turn-Milling Operations*, PhD thesis, UBC, 2018 (tables, figures and
equations are its own; its errata stand in [errata.md](errata.md)), and the papers named in the rows.
"""


def tables() -> str:
    """The page: one table per room."""
    sys.path.insert(0, str(TESTS / "published"))
    parts = [HEAD]
    for file in sorted((TESTS / "published").glob("rows_*.py")):
        spec = importlib.util.spec_from_file_location(file.stem, file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        rows = module.rows()
        parts.append(f"\n## {file.stem.removeprefix('rows_').capitalize()}\n\n{(module.__doc__ or '').strip()}\n")
        parts.append("| quantity | source | published | computed | unit | why |\n|---|---|---|---|---|---|")
        parts += [f"| {' | '.join(map(shown, row))} |" for row in rows]
    return "\n".join(parts) + "\n"


def shown(value: object) -> str:
    """A cell of the table."""
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return " ".join(text.split()).replace("|", "\\|")


def main() -> int:
    """Run everything; 0 where all tests passed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table-only", action="store_true", help="write docs/validation.md only")
    table_only = parser.parse_args().table_only
    PAGE.write_text(tables(), encoding="utf-8")
    print(f"written: {PAGE.relative_to(ROOT)}")
    if table_only:
        return 0
    return subprocess.run([sys.executable, "-m", "pytest", "-m", "slow or not slow"], cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
