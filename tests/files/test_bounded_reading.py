"""Files from outside are read within bounds of memory and time, whatever they do to a library."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import granbench.files.bounded_reading as bounded_reading
from granbench.errors import ConfigurationError, DatasetError
from granbench.files.bounded_reading import read_bounded


def largest(path: Path, *, scale: float) -> np.ndarray:
    return np.loadtxt(path) * scale


def refuse(path: Path) -> None:
    raise ConfigurationError(f"{path}: has no step")


def raise_anything(path: Path) -> None:
    raise KeyError("no such column")


def allocate(path: Path) -> float:
    return float(np.ones(2**29).sum())


def loop(path: Path) -> None:
    while True:
        pass


def wait(path: Path) -> None:
    time.sleep(1000.0)


def crash(path: Path) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def print_noise(path: Path) -> str:
    os.write(1, b"a library speaks\n")
    return "quiet"


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_reading, "LONGEST_READ", 1.5)


def test_answer_is_the_functions(tmp_path: Path) -> None:
    file = tmp_path / "numbers.txt"
    file.write_text("1 2 3\n")
    numbers = read_bounded(file, DatasetError, largest, file, scale=2.0)
    np.testing.assert_array_equal(numbers, [2.0, 4.0, 6.0])


def test_refusal_keeps_its_type_and_text(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"^a.csv: has no step$"):
        read_bounded("a.csv", DatasetError, refuse, Path("a.csv"))


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (raise_anything, "KeyError"),
        (allocate, "GiB of memory"),
        (loop, "takes longer than 1.5 s"),
        (wait, "takes longer than 1.5 s"),
        (crash, "SIGSEGV"),
    ],
)
def test_what_breaks_a_reader_is_one_sentence_and_the_next_file_is_read(
    function: object, said: str, tmp_path: Path
) -> None:
    with pytest.raises(DatasetError, match=rf"^bad\.nc: cannot be read: .*(?:{said})"):
        read_bounded("bad.nc", DatasetError, function, tmp_path / "bad.nc")  # type: ignore[arg-type]
    assert read_bounded("good", DatasetError, print_noise, tmp_path) == "quiet"


def working_folder(path: Path) -> tuple[Path, bool]:
    return Path.cwd(), path.exists()


def test_relative_path_starts_from_the_callers_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after the process has gone elsewhere since the server was started."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        Path(f"{name}.csv").touch()
        file = Path(f"{name}.csv")
        assert read_bounded(file, DatasetError, working_folder, file) == (tmp_path / name, True)


def test_bound_on_computation_grows_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounded_reading, "LONGEST_READ", 60.0)
    monkeypatch.setattr(bounded_reading, "LONGEST_COMPUTATION", 0.1)
    small = tmp_path / "small.nc"
    small.write_bytes(bytes(100))
    with pytest.raises(DatasetError, match="of computation"):
        read_bounded(small, DatasetError, loop, small)
    assert read_bounded(small, DatasetError, compute, small) == "done"
    large = tmp_path / "large.nc"
    large.write_bytes(bytes(20_000))  # 0.2 s more
    assert read_bounded(large, DatasetError, compute_longer, large) == "done"


def compute(path: Path) -> str:
    return "done"


def compute_longer(path: Path) -> str:
    while time.process_time() < 0.15:
        pass
    return "done"


def test_killed_server_is_started_again(tmp_path: Path) -> None:
    assert read_bounded("a", DatasetError, print_noise, tmp_path) == "quiet"
    assert bounded_reading._server is not None
    bounded_reading._server[1].kill()
    bounded_reading._server[1].wait()
    assert read_bounded("b", DatasetError, print_noise, tmp_path) == "quiet"


def test_server_ends_with_the_calling_process(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        read_bounded("a", DatasetError, print_noise, tmp_path)
        assert bounded_reading._server is not None
        os.write(writing, str(bounded_reading._server[1].pid).encode())
        os.kill(os.getpid(), signal.SIGKILL)
    os.close(writing)
    server = int(os.read(reading, 64))
    os.waitpid(child, 0)
    for _ in range(100):
        try:
            os.kill(server, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{server}/stat").read_text().split()[2] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the server outlives the process that started it")
