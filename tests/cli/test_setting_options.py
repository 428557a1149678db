"""The command line names its own options in the questions that laboratory files raise."""

from dataclasses import fields
from pathlib import Path

import pytest
import typer

from granbench.cli import main
from granbench.cli.application import app
from granbench.cli.setting_options import OPTIONS, option_of, option_text
from granbench.errors import Blank, ConfigurationError, Setting
from granbench.laboratory import ImportSettings


def test_every_setting_of_an_import_has_an_option_of_the_command() -> None:
    command = typer.main.get_command(app).commands["fit"]
    offered = {option for parameter in command.params for option in parameter.opts}
    settings = {field.name for field in fields(ImportSettings)} | OPTIONS.keys()
    assert {option_of(name) for name in settings - {"folder", "minutes"}} <= offered


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (Setting("kind", "oedometer"), "--kind oedometer"),
        (Setting("kind"), "--kind"),
        (Setting("tension_positive", True), "--tension-positive"),
        (Setting("columns", {"void_ratio": Blank("HEADER")}), "--column void_ratio=HEADER"),
        (Setting("ignore", ("q [kN]", "t")), "--ignore 'q [kN]' --ignore 't'"),
        (Setting("back_pressure", Blank("PA")), "--back-pressure PA"),
        (Setting("initial_void_ratio", 80.0), "--e0 80"),
    ],
    ids=["value", "name", "flag", "column", "headers", "pressure", "number"],
)
def test_a_setting_is_written_as_an_option(setting: Setting, text: str) -> None:
    assert option_text(setting) == text
    assert ConfigurationError("give ", setting).spelled(option_text) == f"give {text}"


def test_a_question_of_a_file_names_the_option_that_answers_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / "test.csv"
    rows = [f"{0.1 * n},{0.05 * n},{100 + n},{20 + 5 * n}" for n in range(8)]
    data.write_text("\n".join(["eps1 [%],epsv [%],p [kPa],u [kPa]", *rows]))
    words = ["fit", "j2", "--data", str(data), "--out", str(tmp_path / "fit")]
    with pytest.raises(SystemExit) as exit_:
        main(words)
    assert exit_.value.code == 2
    said = capsys.readouterr().err
    assert "--stresses effective" in said
    assert "stresses=" not in said
