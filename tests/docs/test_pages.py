"""The pages: their Python runs, their commands exist, their links lead somewhere."""

import contextlib
import importlib.util
import io
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

import docs_index
import pytest
import typer.main
from page_parts import markers, with_part

from granbench.cli import app, main

ROOT = Path(__file__).parents[2]
PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "docs/examples/demo.sh",
    *sorted(page.relative_to(ROOT).as_posix() for page in (ROOT / "docs").rglob("*.md")),
)


def blocks(page: str, language: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def commands(page: str) -> Iterator[list[str]]:
    """Words of every `granbench` command that a page shows, without the first."""
    text = (ROOT / page).read_text(encoding="utf-8").replace("\\\n", " ")
    for line in re.findall(r"^ *(?:run )?granbench (.*?)(?:  +#.*)?$", text, flags=re.MULTILINE):
        yield shlex.split(line)
    for line in re.findall(r"`granbench ([a-z].*?)`", text):
        yield shlex.split(line)


def run_command(words: Sequence[str]) -> None:
    """Run a `granbench` command in this process; fail unless it leaves with 0."""
    with pytest.raises(SystemExit) as left:
        main([*words])
    assert left.value.code == 0, words


def printed(example: str) -> str:
    """What a Python example prints."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(example, "example", "exec"), {"__name__": "example"})
    return output.getvalue().strip()


def script(path: str) -> ModuleType:
    """A script of the checkout as a module, not run."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_python_on_the_first_page_runs(tmp_path: Path) -> None:
    model, loading = blocks("README.md", "python")
    done = subprocess.run(
        [sys.executable, "-c", loading], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip().endswith("Pa")
    assert "class Secant(torch.nn.Module)" in model


def test_a_user_model_takes_fewer_than_ten_lines_and_is_scored(tmp_path: Path) -> None:
    model, _ = blocks("README.md", "python")
    assert len([line for line in model.splitlines() if line.strip()]) < 10
    (tmp_path / "my_model.py").write_text(model)
    words = "evaluate my_model:cell --task dem-triaxial-mini --axis single-step --seeds 0 --quiet"
    subprocess.run(
        [sys.executable, "-m", "granbench", *words.split(), "--out", "submission.json"],
        cwd=tmp_path,
        check=True,
    )
    assert (tmp_path / "submission.json").is_file()


@pytest.mark.parametrize("page", PAGES)
def test_every_command_that_a_page_shows_exists(page: str) -> None:
    for words in commands(page):
        command, context_words = typer.main.get_command(app), []
        while getattr(command, "commands", None) and len(words) > len(context_words):
            name = words[len(context_words)]
            assert name in command.commands, f"{page}: granbench {' '.join(words)}"
            command = command.commands[name]
            context_words.append(name)
        options = {option for parameter in command.params for option in parameter.opts}
        shown = {word for word in words if word.startswith("--")}
        assert shown <= options | {"--help", "--version"}, f"{page}: granbench {' '.join(words)}"


@pytest.mark.parametrize("page", [page for page in PAGES if page.endswith(".md")])
def test_links_lead_to_files(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for address in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / page).parent.joinpath(address).exists(), f"{page}: {address}"


def mathematics(page: str) -> list[str]:
    """What a page has between dollars, outside of code."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"```.*?```|`[^`\n]*`|^    .*?$", "", text, flags=re.DOTALL | re.MULTILINE)
    display = re.findall(r"\$\$(.*?)\$\$", text, flags=re.DOTALL)
    return display + re.findall(r"(?<!\$)\$([^$\n]+)\$(?!\$)", text)


@pytest.mark.parametrize("page", [page for page in PAGES if page.endswith(".md")])
def test_mathematics_survives_markdown(page: str) -> None:
    """GitHub reads Markdown first: it takes a backslash from before a comma or a brace, and makes
    emphasis of asterisks and of underscores that follow no letter or digit."""
    eaten = re.compile(r"\\[^A-Za-z\s]|\*|[^\w]_|~")
    assert [formula for formula in mathematics(page) if eaten.search(formula)] == []


def test_scores_on_the_page_are_those_of_the_board() -> None:
    pages = script("docs/scores_page.py")
    assert pages.scores_page() == (ROOT / "docs/scores.md").read_text(encoding="utf-8")


RECIPES = {
    "a-metric": "tests/benchmark/test_new_metric.py",
    "an-axis": "tests/benchmark/test_new_axis.py",
    "a-task": "tests/benchmark/test_new_task.py",
    "a-dataset-of-an-existing-family": "tests/generators/test_new_dataset.py",
    "a-generator-family": "tests/generators/test_new_generator.py",
    "a-baseline": "tests/baselines/test_new_baseline.py",
    "a-boundary-value-problem": "tests/fem/test_new_problem.py",
}


@pytest.mark.parametrize("section", RECIPES)
def test_every_recipe_is_what_its_test_performs(section: str) -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert f"(#{section})" in page and f"`{RECIPES[section]}`" in page
    heading = section.replace("-", " ").capitalize().replace("Boundary value", "boundary-value")
    heading = heading.replace("boundary value", "boundary-value")
    text = re.split(r"^## ", page, flags=re.MULTILINE)
    (recipe,) = (part for part in text if part.startswith(f"{heading}\n"))
    code = re.findall(r"^```(?:python|yaml)\n(.*?)^```", recipe, flags=re.DOTALL | re.MULTILINE)[0]
    assert code.strip() in (ROOT / RECIPES[section]).read_text(encoding="utf-8")


def test_the_first_page_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_the_index_of_docs_lists_every_page() -> None:
    """`make docs` writes it."""
    assert docs_index.index() == docs_index.INDEX.read_text(encoding="utf-8")


def test_text_is_put_between_its_markers_and_nowhere_else() -> None:
    begin, end = markers("scores")
    page = f"before\n{begin}\nold\n{end}\nafter"
    written = with_part(page, "scores", "| new |")
    assert written == f"before\n{begin}\n| new |\n{end}\nafter"
    assert with_part(written, "scores", "| new |") == written
    with pytest.raises(ValueError, match="once each"):
        with_part(page, "other", "| new |")


@pytest.mark.parametrize("file", [".ci/run", ".ci/system-packages", "docs/examples/demo.sh"])
def test_shell_scripts_parse(file: str) -> None:
    subprocess.run(["bash", "-n", ROOT / file], check=True)
