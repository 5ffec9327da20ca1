"""What the wheels hold, and that all places tell the same version."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib
import zipfile
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def wheel(project: Path, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """The wheel of turnmill, built from the tree."""
    builders = pytest.importorskip("hatchling.builders.wheel")
    folder = tmp_path_factory.mktemp("wheel")
    (path,) = builders.WheelBuilder(str(project)).build(directory=str(folder), versions=["standard"])
    return zipfile.ZipFile(path)


def tree(project: Path, folder: str, pattern: str) -> set[str]:
    """Files of the tree below a folder, relative to it."""
    return {str(p.relative_to(project / folder)) for p in (project / folder).rglob(pattern)}


def test_the_wheel_holds_code_operations_and_message_texts(project: Path, wheel: zipfile.ZipFile) -> None:
    names = {n for n in wheel.namelist() if ".dist-info/" not in n}
    wanted = {f"turnmill_core/operations/{n}" for n in tree(project, "turnmill_core/operations", "*.yaml")}
    assert len(wanted) >= 9
    messages = {f"turnmill_ros/msg_schemas/{n}" for n in tree(project, "msg_schemas/turnmill_msgs", "*.msg")}
    services = {f"turnmill_ros/msg_schemas/{n}" for n in tree(project, "msg_schemas/turnmill_msgs", "*.srv")}
    assert len(messages) >= 8
    assert len(services) >= 2
    code = {f"{p}/{n}" for p in ("turnmill_core", "turnmill_ros") for n in tree(project, p, "*.py")
            if "msg_schemas" not in n}
    others = names - wanted - messages - services - code
    assert wanted | messages | services | code <= names
    assert {Path(n).suffix for n in others} <= {".html", ".css", ".js", ".typed", ".xml"}, sorted(others)


def test_the_wheel_holds_nothing_else(wheel: zipfile.ZipFile) -> None:
    for name in wheel.namelist():
        assert name.split("/")[0] in {"turnmill_core", "turnmill_ros"} or ".dist-info/" in name
        assert Path(name).suffix not in {".mcap", ".wav", ".csv", ".db3", ".pyc", ".nbi", ".nbc"}
        assert "CMakeLists" not in name
        assert "__pycache__" not in name
        assert "test" not in Path(name).name
    assert sum(i.file_size for i in wheel.infolist()) < 3_000_000


def test_the_wheel_is_described(wheel: zipfile.ZipFile) -> None:
    (name,) = [n for n in wheel.namelist() if n.endswith(".dist-info/METADATA")]
    text = wheel.read(name).decode()
    assert "License-Expression: Apache-2.0" in text
    assert "Requires-Python: <3.13,>=3.11" in text
    base = [r for r in re.findall(r"^Requires-Dist: (.*)$", text, re.M) if "extra ==" not in r]
    assert base
    assert not [r for r in base if r.startswith("ros-")]
    assert any(n.endswith("licenses/LICENSE") for n in wheel.namelist())
    (entry,) = [n for n in wheel.namelist() if n.endswith("entry_points.txt")]
    assert "turnmill = turnmill_ros.cli:main" in wheel.read(entry).decode()


def test_all_places_tell_the_same_version(project: Path) -> None:
    read = {name: (project / name).read_text(encoding="utf-8") for name in (
        "pyproject.toml", "msg_schemas/turnmill_msgs/pyproject.toml", "msg_schemas/turnmill_msgs/package.xml",
        "CITATION.cff", "CHANGELOG.md")}
    version = tomllib.loads(read["pyproject.toml"])["project"]["version"]
    assert tomllib.loads(read["msg_schemas/turnmill_msgs/pyproject.toml"])["project"]["version"] == version
    assert f"<version>{version}</version>" in read["msg_schemas/turnmill_msgs/package.xml"]
    assert f"\nversion: {version}\n" in read["CITATION.cff"]
    assert re.search(rf"^## {re.escape(version)}\b", read["CHANGELOG.md"], re.M)


def test_every_dependency_is_bounded_and_pinned(project: Path) -> None:
    data = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*data["dependencies"], *(r for extra in data["optional-dependencies"].values() for r in extra)]
    pins = dict(re.findall(r"^([\w.-]+)==(.+)$", (project / "constraints.txt").read_text(encoding="utf-8"), re.M))
    for requirement in wanted:
        name = re.split(r"[\[<>=]", requirement)[0]
        assert ">=" in requirement, requirement
        assert name.lower() in pins, f"{name} is not pinned in constraints.txt"


@pytest.mark.ros
def test_the_message_wheel_holds_libraries_and_no_build_rests() -> None:
    try:
        names = [str(f) for f in importlib.metadata.files("turnmill_msgs") or []]
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("turnmill_msgs is not installed: pip install ./msg_schemas/turnmill_msgs")
    assert any(n.endswith("libturnmill_msgs__rosidl_typesupport_fastrtps_c.so") for n in names)
    assert any(n.endswith("share/turnmill_msgs/msg/SensorBlock.msg") for n in names)
    assert any(n.endswith("ament_index/resource_index/packages/turnmill_msgs") for n in names)
    for name in names:
        assert Path(name).suffix not in {".c", ".h", ".hpp", ".cmake", ".sh", ".bash"}
        assert "egg-info" not in name
