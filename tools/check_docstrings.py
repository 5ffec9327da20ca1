"""Docstrings against signatures: what is public has a docstring, and the two agree.

    python tools/check_docstrings.py turnmill_core

Checked for every public module, class, function and method:

1. It has a docstring.
2. A name in backticks in a function's docstring is one of its parameters, or a name the module knows.
3. A line of the form "name: text" or "name [unit]: text" names a parameter or field that exists.
4. A parameter or field that holds a quantity (float, complex or array in its annotation) is named in the
   docstring of the function or of its class, or in a comment on its own line, so that it has a place for its unit.
   Fields that a class takes over from a message ("turnmill_msgs/CuttingLoads") have it in the message's definition.
"""

from __future__ import annotations

import ast
import builtins
import re
import sys
from collections.abc import Iterator
from pathlib import Path

Function = ast.FunctionDef | ast.AsyncFunctionDef
QUANTITY = re.compile(r"\b(float|complex|NDArray|ArrayLike|Arrays?|Floats|Complexes|Vector|Matrix)\b")
MESSAGES = Path(__file__).resolve().parent.parent / "msg_schemas" / "turnmill_msgs" / "msg"
MESSAGE = re.compile(r"turnmill_msgs/(\w+)")
ENTRY = re.compile(r"(?:\A|(?<=\n\n)|(?<=[.:;]\n))\s*`?([a-z_]\w*)`?(?:, `?[a-z_]\w*`?)*(?: \[[^\]]*\])?: ")
BACKTICKS = re.compile(r"(?<!`)(?<!:)`([A-Za-z_]\w*)`(?!`)")
WORDS = {"example", "examples", "errors", "source", "sources", "note", "notes", "where", "with", "and", "or"}


def parameters(node: Function) -> list[ast.arg]:
    """All parameters but self and cls."""
    a = node.args
    named = [*a.posonlyargs, *a.args, *a.kwonlyargs, *(x for x in (a.vararg, a.kwarg) if x)]
    return [x for x in named if x.arg not in {"self", "cls"}]


def fields(node: ast.ClassDef) -> list[ast.AnnAssign]:
    """Annotated public fields."""
    return [n for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)
            and not n.target.id.startswith("_")]


def names_known(tree: ast.AST) -> set[str]:
    """Every name that occurs in a module, and the builtins."""
    known = set(dir(builtins))
    for node in ast.walk(tree):
        for attribute in ("id", "attr", "name", "arg", "asname"):
            value = getattr(node, attribute, None)
            if isinstance(value, str):
                known.add(value)
    return known


def strings(tree: ast.AST) -> set[str]:
    """String constants of a module: values such as "exact" of a Literal."""
    return {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def message_fields(text: str) -> set[str]:
    """Fields of the messages that a docstring names."""
    found = set()
    for name in MESSAGE.findall(text):
        path = MESSAGES / f"{name}.msg"
        if path.exists():
            found |= set(re.findall(r"^\S+ +([a-z]\w*)", path.read_text(encoding="utf-8"), re.M))
    return found


def mentioned(name: str, text: str) -> bool:
    """True where a name occurs in a text, also in words (tool_speed: tool speed) or as one of many (speeds: speed)."""
    spaced = re.sub(r"\s+", " ", name.replace("_", " "))
    one = re.sub(r"ies$", "y", spaced) if spaced.endswith("ies") else spaced.removesuffix("s")
    words = " ".join(text.split())
    return bool(re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text) or any(
        re.search(rf"\b{re.escape(form)}s?\b", words, re.I) for form in (spaced, one) if len(form) > 2))


class Checker:
    """Collects what is wrong in one file."""

    def __init__(self, path: Path, values: set[str]) -> None:
        self.path, self.found = path, list[str]()
        text = path.read_text(encoding="utf-8")
        self.lines, self.tree = text.splitlines(), ast.parse(text)
        self.known = names_known(self.tree) | values

    def say(self, line: int, text: str) -> None:
        """Note a finding."""
        self.found.append(f"{self.path}:{line}: {text}")

    def comment(self, line: int) -> str:
        """The comment on a line, or nothing."""
        return self.lines[line - 1].partition("#")[2]

    def run(self) -> list[str]:
        """Check the module; returns the findings."""
        if self.tree.body and not ast.get_docstring(self.tree):
            self.say(1, "the module has no docstring")
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                self.check_class(node)
            elif isinstance(node, Function) and not node.name.startswith("_"):
                self.check_function(node, "")
        return self.found

    def check_class(self, node: ast.ClassDef) -> None:
        """A class, its fields and its public methods."""
        text = ast.get_docstring(node) or ""
        if not text:
            self.say(node.lineno, f"class {node.name} has no docstring")
            return
        members = {f.target.id for f in fields(node) if isinstance(f.target, ast.Name)}
        members |= {n.name for n in node.body if isinstance(n, Function)}
        members |= {x.arg for n in node.body if isinstance(n, Function) and n.name == "__init__" for x in parameters(n)}
        explained = message_fields(text)
        for entry in fields(node):
            name = ast.unparse(entry.target)
            if name not in explained and QUANTITY.search(ast.unparse(entry.annotation)) and not (
                mentioned(name, text) or self.comment(entry.end_lineno or entry.lineno)
            ):
                self.say(entry.lineno, f"class {node.name}: the docstring does not mention the field {name}")
        if fields(node):
            self.check_entries(node.lineno, f"class {node.name}", text, members)
        for method in node.body:
            if isinstance(method, Function) and not method.name.startswith("_"):
                self.check_function(method, text)

    def check_function(self, node: Function, class_text: str) -> None:
        """A function or method."""
        text = ast.get_docstring(node) or ""
        if not text:
            self.say(node.lineno, f"{node.name} has no docstring")
            return
        have = {x.arg for x in parameters(node)}
        for name in BACKTICKS.findall(text):
            if name not in have | self.known:
                self.say(node.lineno, f"{node.name}: the docstring names `{name}`, which does not exist")
        self.check_entries(node.lineno, node.name, text, have | self.known)
        for parameter in parameters(node):
            annotation = ast.unparse(parameter.annotation) if parameter.annotation else ""
            if QUANTITY.search(annotation) and not mentioned(parameter.arg, text + class_text):
                self.say(node.lineno, f"{node.name}: the docstring does not mention the quantity {parameter.arg}")

    def check_entries(self, line: int, owner: str, text: str, have: set[str]) -> None:
        """Lines of the form "name: text"."""
        for match in ENTRY.finditer(text):
            for name in re.findall(r"[a-z_]\w*", match.group(0).partition("[")[0].partition(":")[0]):
                if name not in have | WORDS:
                    self.say(line, f"{owner}: the docstring describes {name}, which does not exist")


def sources(roots: list[str]) -> Iterator[Path]:
    """Public Python files below the roots."""
    for root in roots:
        for path in sorted(Path(root).rglob("*.py")):
            if not any(part.startswith("_") for part in path.relative_to(root).parts if part != "__init__.py"):
                yield path


def main() -> None:
    """Check and report; exit code 1 where something was found."""
    files = list(sources(sys.argv[1:]))
    if not files:
        sys.exit("check_docstrings: no Python files; name a folder")
    values = set().union(*(strings(ast.parse(path.read_text(encoding="utf-8"))) for path in files))
    found = [finding for path in files for finding in Checker(path, values).run()]
    for finding in found:
        print(finding)
    print(f"check_docstrings: {len(files)} files, {len(found)} findings")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
