"""The path or test, and the start, that the options of `granbench drive` describe."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from granbench.cli.model_options import named_start_options
from granbench.errors import ConfigurationError

if TYPE_CHECKING:
    from torch import Tensor

    from granbench.cells.contract import MaterialCell
    from granbench.cells.find import FoundModel
    from granbench.element_test.prescribed_path import PrescribedPath
    from granbench.element_test.start import Start
    from granbench.paths.strain_files import PathTable

DEFAULT_STRAIN = 0.2
DEFAULT_STEPS = 200


@dataclass(frozen=True)
class DriveRequest:
    """The path or test that the options name; an option that is not given is None.

    Parameters
    ----------
    path : file of strains or records
    control : name of a standard test
    strain, turning_points, steps, b : settings of that test
    order : component order of a classical model
    """

    path: Path | None
    control: str | None
    strain: str | None
    turning_points: str | None
    steps: int | None
    b: float | None
    order: str | None

    def prepared(
        self, found: "FoundModel", start: "Start"
    ) -> tuple["MaterialCell", "PrescribedPath", "Tensor"]:
        """The cell, the prescribed path, and the state (point, n_state) at its start.

        Raises
        ------
        GranbenchError
            Naming the option, or file, row and column, that is invalid or contradicts another.
        """
        if self.path is not None and self.path.suffix == ".nc":
            return self._along_records(found, start)
        from granbench.paths.strain_files import read_path

        table = None if self.path is None else read_path(self.path)
        if table is not None and table.driving_column is None:
            return self._along_table(table, found, start)
        return self._through_test(table, found, start)

    def _along_records(
        self, found: "FoundModel", start: "Start"
    ) -> tuple["MaterialCell", "PrescribedPath", "Tensor"]:
        from granbench.data.adapters import conditions_of
        from granbench.element_test.prescribed_path import PrescribedPath
        from granbench.records import open_records
        from granbench.tensors import component_order

        self._refuse_test_options()
        with open_records(self.path or "") as opened:
            records = opened.load()
        order = component_order(tuple(str(c) for c in records["component"].values))
        cell = found.in_order(order).cell
        path = PrescribedPath.of_records(records, str(self.path), cell)
        with named_start_options(start):
            return cell, path, start.state(cell, conditions_of(records))

    def _along_table(
        self, table: "PathTable", found: "FoundModel", start: "Start"
    ) -> tuple["MaterialCell", "PrescribedPath", "Tensor"]:
        from granbench.element_test.prescribed_path import PrescribedPath

        self._refuse_test_options()
        cell = found.in_order(table.order).cell
        with named_start_options(start):
            state = start.state(cell)
        stress = state[0, cell.layout["stress"]].double().numpy()
        return cell, PrescribedPath.of_table(table, stress, cell), state

    def _through_test(
        self, table: "PathTable | None", found: "FoundModel", start: "Start"
    ) -> tuple["MaterialCell", "PrescribedPath", "Tensor"]:
        from granbench.element_test.prescribed_path import PrescribedPath, cell_for_test
        from granbench.paths.standard_tests import find_test, strain_history
        from granbench.units.quantity_text import strain_from_text

        if self.control is None:
            raise ConfigurationError(
                f"{self.path}: column {table.driving_column} drives a standard test; add --control "
                "NAME"
                if table
                else "no path or test is given; give --control NAME, or --path FILE with strains"
            )
        test = find_test(self.control)
        if self.b is not None and not 0.0 <= self.b <= 1.0:
            raise ConfigurationError(f"--b {self.b:g} must lie in [0, 1]")
        if table is None:
            turns = self.turning_points.split(",") if self.turning_points is not None else []
            corners = [strain_from_text("--turning-points ", turn) for turn in turns]
            end = DEFAULT_STRAIN
            if self.strain is not None:
                end = strain_from_text("--strain ", self.strain)
            steps = DEFAULT_STEPS if self.steps is None else self.steps
            history = strain_history([*corners, end], steps)
        else:
            self._refuse(
                ("--strain", self.strain),
                ("--turning-points", self.turning_points),
                ("--steps", self.steps),
                why=f"{self.path} gives the driving strain",
            )
            history = table.history()
        with named_start_options(start):
            pressure = start.isotropic_pressure("a standard test")
        programme = test.programme(pressure, float(abs(history).max()), self.b)
        column = "eps_shear" if programme.driving_component == "xy" else "eps_axial"
        if table is not None and table.driving_column != column:
            raise ConfigurationError(
                f"{self.path}: column {table.driving_column} does not drive {self.control}; name "
                f"it {column}"
            )
        if self.order is not None and not found.order_is_open:
            raise ConfigurationError(
                f"--order is for classical models, but {found.name} has fixed components; leave it "
                "out"
            )
        cell = cell_for_test(found, programme, self.order)
        path = PrescribedPath.of_test(self.control, programme, history, cell.order, table)
        with named_start_options(start):
            return cell, path, start.state(cell)

    def _refuse_test_options(self) -> None:
        self._refuse(
            ("--control", self.control), ("--strain", self.strain),
            ("--turning-points", self.turning_points), ("--steps", self.steps), ("--b", self.b),
            ("--order", self.order), why=f"{self.path} prescribes every component",
        )  # fmt: skip

    @staticmethod
    def _refuse(*options: tuple[str, object], why: str) -> None:
        for option, value in options:
            if value is not None:
                raise ConfigurationError(f"{option} is given, but {why}; leave one of them out")


def scalars_at_start(
    e0: float | None, ocr: float | None, start: Sequence[str] | None
) -> dict[str, float]:
    """Scalars at the start other than the pressure, under dataset names.

    Parameters
    ----------
    e0, ocr : void ratio and overconsolidation ratio, None if not given
    start : texts NAME=VALUE

    Raises
    ------
    ConfigurationError
        If a text is not such a pair, or a scalar is given twice.
    """
    given = [("initial_void_ratio", e0), ("overconsolidation_ratio", ocr)]
    for text in start or ():
        name, sign, number = text.partition("=")
        if not (sign and name.isidentifier()):
            raise ConfigurationError(f"--start {text!r}: give NAME=VALUE, as grading_index=1.06")
        given.append((name, _start_value(name, number)))
    scalars: dict[str, float] = {}
    for name, value in given:
        if name in scalars:
            raise ConfigurationError(f"{name} at the start is given twice; leave one out")
        if value is not None:
            scalars[name] = value
    if "initial_void_ratio" in scalars and "overconsolidation_ratio" in scalars:
        raise ConfigurationError("--e0 and --ocr both set the density at the start; give one")
    return scalars


def _start_value(name: str, text: str) -> float:
    """The value of a scalar at the start; a stress may have a unit."""
    if any(word in name for word in ("stress", "pressure")):
        from granbench.units.quantity_text import pressure_from_text

        return pressure_from_text(f"--start {name}=", text)
    try:
        return float(text)
    except ValueError as error:
        raise ConfigurationError(
            f"--start {name} {text!r} is not a number; give one such as 1.06"
        ) from error
