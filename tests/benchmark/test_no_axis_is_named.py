"""No module outside of the folder of an axis names an axis, a protocol or a metric."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from granbench.benchmark.registry import axes

ROOT = Path(__file__).parents[2]
AXES = ROOT / "granbench" / "benchmark" / "axes"
MODULES = [
    file
    for folder in ("granbench/benchmark", "granbench/cli", "leaderboard")
    for file in sorted((ROOT / folder).rglob("*.py"))
    if AXES not in file.parents
] + [ROOT / "docs" / "scoring_page.py", ROOT / "docs" / "scores_page.py"]
TEMPLATES = sorted((ROOT / "leaderboard" / "site").glob("*.j2"))

OTHER_MEANINGS = {
    "parameters", "cost", "window", "noise", "rotation", "compression", "swap", "tangent",
    "dissipation",
}  # fmt: skip
"""Words that are also something else: parameters of a model, compression of a file, ..."""

NAMES = {
    name
    for axis in axes()
    for name in (
        axis.name,
        *axis.names,
        *(part.name for part in axis.parts),
        *(metric.name for metric in axis.metrics()),
    )
} - OTHER_MEANINGS


def texts(tree: ast.AST) -> Iterator[ast.Constant]:
    """The texts of a module, without its docstrings and the strings that follow a name."""
    loose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in loose:
            yield node


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ROOT)))
def test_no_module_names_an_axis_or_a_metric(file: Path) -> None:
    tree = ast.parse(file.read_text())
    named = {(node.lineno, node.value) for node in texts(tree) if node.value in NAMES}
    assert not named


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ROOT)))
def test_no_module_imports_from_the_folder_of_an_axis(file: Path) -> None:
    imported = {
        node.module
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module
    }
    assert not [module for module in imported if module.startswith("granbench.benchmark.axes.")]


@pytest.mark.parametrize("file", TEMPLATES, ids=lambda file: file.name)
def test_no_template_names_an_axis_or_a_metric(file: Path) -> None:
    words = set(re.findall(r"[a-z][a-z0-9_-]+", file.read_text()))
    assert not words & NAMES
