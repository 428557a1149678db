"""What user code can do wrong when it makes a cell: one sentence with the line of its own file."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch
import xarray as xr

from granbench.cells.find import find_cells
from granbench.cells.user_code import LONGEST_REASON, failure_location, user_code
from granbench.errors import ConfigurationError, ModelError

HEAD = """import torch
from granbench.cells.contract import ModuleCell
"""
NET = """
class Net(torch.nn.Module):
    def forward(self, dstrain, stress):
        return stress + 1e6 * dstrain
"""

FAILING = {
    "a missing file": ("def cell():\n    return torch.load('weights.pt')", "FileNotFoundError", 4),
    "a library call": ("def cell():\n    torch.zeros(2) @ torch.zeros(3)", "RuntimeError", 4),
    "division": ("def cell():\n    return 1 / 0", "ZeroDivisionError", 4),
    "at import": ("x = 1\nraise ValueError('no')\n", "ValueError", 4),
    "a missing import": ("import no_such_package", "no_such_package", 3),
    "a syntax error": ("def cell(:\n    pass", "SyntaxError", 3),
    "recursion": ("def cell():\n    return cell()", "RecursionError", 4),
    "leaving": ("import sys\ndef cell():\n    sys.exit(0)", "SystemExit", 5),
    "leaving at import": ("raise SystemExit", "SystemExit", 3),
    "a base exception": (
        "class Mine(BaseException):\n    pass\ndef cell():\n    raise Mine('gone')", "Mine", 6
    ),
    "text that fails": (
        "class Bad(Exception):\n    def __str__(self):\n        raise ValueError\n"
        "def cell():\n    raise Bad", "Bad", 7
    ),
    "escapes": ("def cell():\n    raise ValueError('\\x1b[31mred')", "ValueError", 4),
    "a long text": ("def cell():\n    raise ValueError('x' * 100_000)", "ValueError", 4),
}  # fmt: skip

RETURNING = {
    "nothing": ("def cell():\n    pass", "returned nothing; end it with `return`"),
    "a class": ("def cell():\n    return Net", r"the class Net; return an instance, as Net\(\)"),
    "a module": ("def cell():\n    return Net()", "type Net.*ModuleCell"),
    "a number": ("def cell():\n    return 3", "type int.*MaterialCell"),
    "an argument": ("def cell(hidden):\n    pass", "argument 'hidden'.*default value"),
    "a required option": ("def cell(*, layers, seed):\n    pass", "argument 'layers'"),
    "a position": ("def cell(seed, /):\n    pass", "argument 'seed'.*by keyword"),
    "the module itself": ("cell = Net()", "type Net itself; give a function.*ModuleCell"),
    "the cell itself": (
        "cell = ModuleCell(Net(), name='n')", "type ModuleCell itself; give a function"
    ),
    "another name": ("def cells():\n    pass", "no function 'cell': did you mean 'cells'"),
    "a wrong name": ("def cell():\n    return ModuleCell(Net(), name='')", "no `name`"),
    "a wrong layout": (
        "from granbench.cells.contract import StateLayout\ndef cell():\n"
        "    return ModuleCell(Net(), name='n', layout=StateLayout.of(hidden=3))",
        "no slice 'stress'",
    ),
}  # fmt: skip


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Write a user's module, which is forgotten after the test."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(text: str, name: str = "own_model") -> str:
        monkeypatch.delitem(sys.modules, name, raising=False)
        (tmp_path / f"{name}.py").write_text(text)
        return f"{name}:cell"

    yield write
    sys.modules.pop("own_model", None)


@pytest.mark.parametrize("case", FAILING)
def test_a_failure_is_one_sentence_with_the_line_of_the_users_file(
    case: str, written, records: xr.Dataset
) -> None:
    body, kind, line = FAILING[case]
    with pytest.raises(ModelError) as failed:
        find_cells(written(HEAD + body), records)
    text = str(failed.value)
    assert kind in text
    assert f"at own_model.py line {line}" in text
    assert len(text) < LONGEST_REASON + 200 and text.isprintable()


@pytest.mark.parametrize("case", RETURNING)
def test_a_factory_that_makes_no_cell_says_what_to_return(
    case: str, written, records: xr.Dataset
) -> None:
    body, remedy = RETURNING[case]
    with pytest.raises(ModelError, match=remedy):
        find_cells(written(HEAD + NET + body), records)


@pytest.mark.parametrize(
    ("model", "remedy"),
    [
        ("own_model.py:cell", "own_model$"),
        ("models/own:cell", r"models\.own$"),
        ("gone:cell", "run"),
    ],
)
def test_a_module_that_is_not_there(model: str, remedy: str, written, records: xr.Dataset) -> None:
    written(HEAD)
    with pytest.raises(ModelError, match=rf"there is no module.*{remedy}"):
        find_cells(model, records)


def test_new_weights_follow_from_the_seed(written, records: xr.Dataset) -> None:
    """A factory that takes no seed makes the same weights again for the same seed."""
    body = "def cell():\n    return ModuleCell(torch.nn.Bilinear(3, 3, 3), name='new')"
    model = written(HEAD + body)
    state = torch.get_rng_state()
    first, second = (find_cells(model, records, seeds=(4, 5)) for _ in range(2))
    for seed in (4, 5):
        assert torch.equal(first.cells[seed].module.weight, second.cells[seed].module.weight)
    assert not torch.equal(first.cells[4].module.weight, first.cells[5].module.weight)
    assert torch.equal(torch.get_rng_state(), state)


def test_what_user_code_prints_is_not_the_output(written, records: xr.Dataset, capsys) -> None:
    body = "print('loaded')\ndef cell():\n    print('made')\n    return ModuleCell(Net(), name='n')"
    find_cells(written(HEAD + NET + body), records)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "loaded" in captured.err and "made" in captured.err


def test_a_package_of_the_users_that_is_installed_is_named(tmp_path: Path) -> None:
    """Not torch, and not another package that the user's calls."""
    site = tmp_path / "site-packages"
    for package, text in {
        "soil_nets": "import solver\n\n\ndef cell():\n    return solver.solve()\n",
        "solver": "import torch\n\n\ndef solve():\n    return torch.load('weights.pt')\n",
    }.items():
        (site / package).mkdir(parents=True)
        (site / package / "__init__.py").write_text(text)
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from granbench.cells.user_code import failure_location\n"
        "import soil_nets\n"
        "try:\n    soil_nets.cell()\nexcept Exception as error:\n"
        "    print(failure_location(error.with_traceback(error.__traceback__.tb_next)))\n"
    )
    found = subprocess.run(
        [sys.executable, "-c", script, str(site)], capture_output=True, text=True, check=True
    )
    assert "FileNotFoundError" in found.stdout
    assert "at __init__.py line 5" in found.stdout


def test_errors_of_granbench_and_ctrl_c_pass() -> None:
    for error in (ConfigurationError("p0 must be positive"), KeyboardInterrupt()):
        with pytest.raises(type(error)) as passed, user_code("it failed"):
            raise error
        assert passed.value is error


def test_an_error_without_a_traceback_has_a_sentence_too() -> None:
    assert failure_location(ValueError("no")).startswith("with ValueError (no) at")
