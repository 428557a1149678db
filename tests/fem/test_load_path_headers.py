"""Headers of load paths."""

from pathlib import Path

import pytest

from granbench.errors import ConfigurationError
from granbench.fem.load_path_file import read_load_path


@pytest.mark.parametrize(
    "header", ["Time,Displacement", "TIME [s],Displacement [m]", "time (s),DISPLACEMENT (m)"]
)
def test_headers_ignore_case(header: str, tmp_path: Path) -> None:
    path = tmp_path / "load.csv"
    path.write_text(f"{header}\n0,0\n1,0.01\n2,0.005\n")
    found = read_load_path(path)
    assert found.values[-1] == pytest.approx(0.005)


@pytest.mark.parametrize(
    "header",
    ["time,displacement [mm] x10", "time,displacement [mm]/2", "time [s] x60,displacement [mm]",
     "time,displacement,Displacement [mm]"],
)  # fmt: skip
def test_another_meaning_is_refused(header: str, tmp_path: Path) -> None:
    path = tmp_path / "load.csv"
    rows = ["0,0,0", "1,1,0.01"] if header.count(",") == 2 else ["0,0", "1,0.01"]
    path.write_text("\n".join([header, *rows]) + "\n")
    with pytest.raises(ConfigurationError, match="load path"):
        read_load_path(path)
