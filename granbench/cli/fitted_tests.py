"""The laboratory tests that the options of `granbench fit` name."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from granbench.errors import ConfigurationError

if TYPE_CHECKING:
    from granbench.laboratory import ImportSettings, LaboratoryTest


def selected_tests(
    data: Sequence[str], leave_out: Sequence[str], reading: "ImportSettings"
) -> tuple[list["LaboratoryTest"], list["LaboratoryTest"]]:
    """The tests to fit, and those that are only predicted."""
    from granbench.laboratory import read_selected

    tests = [test for text in data for test in read_selected(text, reading)]
    left_out: list[LaboratoryTest] = []
    for text in leave_out:
        named = [test for test in tests if test.name == text]
        if not named and not Path(text.partition("::")[0]).exists():
            raise ConfigurationError(
                f"--leave-out {text!r} is neither a file nor a test of --data, which are "
                f"{', '.join(test.name for test in tests[:8]) or 'none'}"
            )
        left_out += named or read_selected(text, reading)
        tests = [test for test in tests if test not in named]
    names = [test.name for test in (*tests, *left_out)]
    if repeated := [name for name in names if names.count(name) > 1]:
        raise ConfigurationError(
            f"two tests are called {repeated[0]!r}; rename a file, or give each test once"
        )
    return tests, left_out


def require_shear(tests: Sequence["LaboratoryTest"], parameters: Sequence[str]) -> None:
    """Refuse to fit all parameters to isotropic compression, which does not determine strength."""
    from granbench.laboratory.laboratory_test import NO_SHEAR

    if tests and not any(test.is_sheared for test in tests):
        raise ConfigurationError(
            f"{tests[0].source}: {'the test has' if len(tests) == 1 else 'the tests have'} no "
            f"shear, q stays below {100.0 * NO_SHEAR:g} % of p, so strength and shear stiffness "
            "cannot be found; add a test with shear, or name the parameters that compression "
            f"determines with --free: {', '.join(parameters)}"
        )
