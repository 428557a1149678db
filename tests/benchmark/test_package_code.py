"""Calls of code that another package brings."""

import pytest

from granbench.benchmark.metric import NotApplicable
from granbench.benchmark.package_code import package_code
from granbench.errors import ConfigurationError, SubmissionError


@pytest.mark.parametrize("error", [ValueError("two\nlines"), SystemExit(1)])
def test_an_exception_is_reported_in_one_line(error: BaseException) -> None:
    with pytest.raises(ConfigurationError) as raised, package_code("axis 'rest'", "my-package"):
        raise error
    text = str(raised.value)
    assert "\n" not in text
    for named in ("axis 'rest'", "my-package", type(error).__name__, "test_package_code.py line"):
        assert named in text


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), NotApplicable("no void ratio"), SubmissionError("no file")]
)
def test_what_is_not_a_mistake_in_the_package_passes(error: BaseException) -> None:
    with pytest.raises(type(error)) as raised, package_code("axis 'rest'", "my-package"):
        raise error
    assert raised.value is error


def test_an_exception_in_granbench_passes() -> None:
    with pytest.raises(ValueError, match="a bug"), package_code("axis 'rollout'", None):
        raise ValueError("a bug")


def test_printed_text_is_not_the_output(capsys: pytest.CaptureFixture[str]) -> None:
    with package_code("axis 'rest'", "my-package"):
        print("here")
    assert capsys.readouterr() == ("", "here\n")
