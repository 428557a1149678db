"""The package: its list of folders, its wheel, its version bounds and the way its parts depend."""

import ast
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import granbench
from granbench.data.registry import entries

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOLDERS = {"granbench": "granbench"} | {
    folder: name
    for name, folder in PROJECT["tool"]["setuptools"]["package-dir"].items()
    if name != folder
}
"""Top-level folder of the checkout -> package that it is imported as."""


def modules() -> dict[str, Path]:
    """Every module of the checkout by its file in a wheel."""
    return {
        str(Path(*package.split(".")) / file.relative_to(ROOT / folder)): file
        for folder, package in FOLDERS.items()
        for file in (ROOT / folder).rglob("*.py")
    }


def requirements() -> list[Requirement]:
    project = PROJECT["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    return [Requirement(line) for listed in lists for line in listed]


def pins(file: str) -> dict[str, str]:
    lines = (ROOT / "requirements" / file).read_text().splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pairs}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """A wheel built from a copy of the checkout, so that no old build folder leaks into it."""
    copy = tmp_path_factory.mktemp("checkout")
    for name in (*FOLDERS, "pyproject.toml", "README.md", "LICENSE", "LICENSE-DATA"):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, copy / name)
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", "dist", "."],
        cwd=copy,
        check=True,
        capture_output=True,
    )
    (file,) = (copy / "dist").glob("*.whl")
    return zipfile.ZipFile(file)


def test_listed_packages_and_folders_agree() -> None:
    found = {Path(name).parent.as_posix().replace("/", ".") for name in modules()}
    assert set(PROJECT["tool"]["setuptools"]["packages"]) == found


def test_every_folder_of_modules_is_a_package() -> None:
    folders = {file.parent for file in modules().values()}
    assert all((folder / "__init__.py").is_file() for folder in folders)


@pytest.mark.wheel
def test_wheel_holds_every_module(wheel: zipfile.ZipFile) -> None:
    inside = {name for name in wheel.namelist() if name.endswith(".py")}
    assert inside == set(modules())


@pytest.mark.wheel
def test_wheel_holds_what_the_package_reads(wheel: zipfile.ZipFile) -> None:
    inside = set(wheel.namelist())
    expected = {"granbench/py.typed", "granbench/leaderboard/submission.schema.json"}
    for folder, pattern in (
        ("granbench/data/registry", "*.yaml"),
        ("granbench/data/registry/tasks", "*.yaml"),
        ("granbench/data/mini", "*.nc"),
        ("leaderboard/site", "*.*"),
    ):
        files = list((ROOT / folder).glob(pattern))
        assert files, f"{folder} has no {pattern}"
        package = folder if folder.startswith("granbench") else f"granbench/{folder}"
        expected |= {f"{package}/{file.name}" for file in files}
    assert expected <= inside


@pytest.mark.wheel
def test_wheel_leaves_large_data_and_submissions_out(wheel: zipfile.ZipFile) -> None:
    data = [entry for entry in wheel.infolist() if entry.filename.endswith((".nc", ".safetensors"))]
    assert all(entry.filename.startswith("granbench/data/mini/") for entry in data)
    assert all(entry.file_size < 1_000_000 for entry in data)


@pytest.mark.wheel
def test_the_data_wheel_holds_every_reference_dataset(tmp_path: Path) -> None:
    copy = tmp_path / "data"
    shutil.copytree(ROOT / "datasets", copy, ignore=shutil.ignore_patterns("__pycache__", "*.nc"))
    files = {file.name for file in (ROOT / "datasets").glob("*.nc")}
    for name in files:  # what is in them is checked elsewhere
        (copy / name).touch()
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", "dist", "."],
        cwd=copy,
        check=True,
        capture_output=True,
    )
    (file,) = (copy / "dist").glob("granbench_data-*.whl")
    inside = {Path(name).as_posix() for name in zipfile.ZipFile(file).namelist()}
    assert {f"granbench_data/{name}" for name in (*files, "__init__.py")} <= inside
    assert any(name.endswith("licenses/LICENSE-DATA") for name in inside)
    registered = {entry.file for entry in entries() if entry.tier == "core"}
    assert registered == files


@pytest.mark.parametrize("group", ["granbench.baselines", "granbench.models"])
def test_everything_that_is_registered_can_be_loaded_under_its_own_name(group: str) -> None:
    names = set(PROJECT["project"]["entry-points"][group])
    points = entry_points(group=group)
    assert names <= {point.name for point in points}
    for point in points:
        if point.name in names:
            assert point.load().name == point.name


def test_every_generator_that_is_registered_can_be_loaded() -> None:
    names = set(PROJECT["project"]["entry-points"]["granbench.generators"])
    points = entry_points(group="granbench.generators")
    assert names <= {point.name for point in points}
    assert all(point.load().datasets for point in points if point.name in names)


def test_lower_bounds_are_those_of_the_project() -> None:
    bounds = {
        canonicalize_name(requirement.name): next(
            spec.version for spec in requirement.specifier if spec.operator == ">="
        )
        for requirement in requirements()
    }
    assert pins("lower-bounds.txt") == bounds


def test_constraints_pin_every_requirement_within_its_bounds() -> None:
    pinned = pins("constraints.txt")
    for requirement in requirements():
        version = pinned[canonicalize_name(requirement.name)]
        assert requirement.specifier.contains(version), requirement


def test_changelog_begins_with_this_version() -> None:
    lines = (ROOT / "CHANGELOG.md").read_text().splitlines()
    headings = [line for line in lines if line.startswith("## ")]
    assert headings[0].split()[1] == granbench.__version__


def test_no_two_test_files_share_a_name() -> None:
    # pytest imports them by their bare names.
    names = Counter(
        file.name for file in (ROOT / "tests").rglob("*.py") if file.name != "conftest.py"
    )
    assert [name for name, count in names.items() if count > 1] == []


LAYERS = (
    ("errors", "tensors", "registration"),
    ("files", "units", "records.turning_points"),
    ("cells", "cell"),
    ("records",),
    ("tables", "plotting", "paths", "fem.mesh_files", "fem.statement"),
    ("data",),
    ("models",),
    ("cells.find",),
    ("element_test",),
    ("fem", "plotting.fem", "plotting.problem"),
    ("generators",),
    ("benchmark", "plotting.predictions"),
    ("laboratory",),
    ("fitting",),
    ("baselines", "leaderboard"),
    ("cli",),
)
"""A module imports from its own layer and from those before it. Figures need nothing but arrays;
those of an analysis ask the finite elements what belongs to an element."""


def layer(module: str) -> int:
    _, *parts = module.split(".")
    numbers = {part: number for number, layer in enumerate(LAYERS) for part in layer}
    return numbers.get(".".join(parts[:2]), numbers[parts[0]])


def imported(file: Path) -> set[str]:
    """Names of GranBench's modules that a module imports when it is run or called."""
    tree = ast.parse(file.read_text())
    lines = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom | ast.Import)]
    names: set[str] = set()
    for line in lines:
        if isinstance(line, ast.Import):
            names |= {alias.name for alias in line.names}
        elif line.module == "granbench":
            names |= {f"granbench.{alias.name}" for alias in line.names}
        else:
            names.add(str(line.module))
    return {name for name in names if name.startswith("granbench.") and "__" not in name}


def test_dependencies_point_one_way() -> None:
    for name, file in modules().items():
        module = name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        if "." not in module or module == "granbench.__main__":
            continue
        for target in imported(file):
            assert layer(target) <= layer(module), f"{module} imports {target}"


def test_finite_elements_and_models_draw_nothing() -> None:
    for name, file in modules().items():
        if name.startswith(("granbench/fem/", "granbench/models/")):
            plots = {target for target in imported(file) if target.startswith("granbench.plotting")}
            assert not plots, f"{name} imports {plots}"
