"""Training the recurrent baselines end to end."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import xarray as xr

from granbench.baselines import recurrent_records
from granbench.baselines.lstm import BASELINE as LSTM
from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_baseline import RecurrentBaseline
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training import Recipe
from granbench.baselines.training.history import read_history
from granbench.baselines.training.model_files import WEIGHTS_FILE
from granbench.baselines.training.progress import TRAINING_FILE
from granbench.cells.baseline import TrainingRequest
from granbench.cells.find import find_cells
from granbench.errors import ConfigurationError, ModelError, RegistryError
from granbench.records import open_records, write_records

EPOCHS = 30

RUN = """
import sys, time
from pathlib import Path
import torch
from granbench.cells.baseline import TrainingRequest, find_baseline
from granbench.baselines.training import engine
from granbench.records import open_records, write_records
torch.set_num_threads(1)
engine.SAVE_EVERY_SECONDS = -1.0
find_baseline("mlstm").train(
    TrainingRequest(
        open_records(sys.argv[1]),
        Path(sys.argv[2]),
        epochs=int(sys.argv[3]),
        on_epoch=lambda report: time.sleep(0.05),  # time to be killed in
    )
)
"""


def few(records: xr.Dataset) -> xr.Dataset:
    """One path in training and one in validation."""
    split = records["split"].values.tolist()
    return records.isel(path=[split.index("train"), split.index("validation")])


def losses(folder: Path) -> list[tuple[float, float]]:
    return [(report.training_loss, report.validation_loss) for report in read_history(folder)]


@pytest.mark.parametrize("output", ["absolute", "change", "increment"])
def test_mlstm_overfits_a_tiny_set(records: xr.Dataset, tmp_path: Path, output: str) -> None:
    baseline = RecurrentBaseline(
        "mlstm",
        "overfitting",
        {
            "tiny": (
                RecurrentConfiguration(initial_layer=True, output=output),
                Recipe(batch_size=7, learning_rate=1e-2, schedule="cosine", epochs=100),
            )
        },
    )
    folder = baseline.train(TrainingRequest(few(records), tmp_path))
    assert losses(folder)[-1][0] < 5e-3 * losses(folder)[0][0]


def test_the_trained_cell_has_the_validation_loss_of_its_best_epoch(
    records: xr.Dataset, tmp_path: Path
) -> None:
    folder = MLSTM.train(TrainingRequest(records, tmp_path, epochs=3))
    cell = find_cells(str(folder), records).cell
    validation = records.isel(path=records["split"].values == "validation")
    source = recurrent_records.window_source(
        validation, cell.network.scaling, 20, torch.device("cpu")
    )
    batch = next(source.batches(torch.arange(source.item_count), source.item_count))
    best = min(loss for _, loss in losses(folder))
    assert cell.network.loss(batch).item() == pytest.approx(best, rel=1e-5)


def test_validation_and_test_paths_do_not_touch_the_weights(
    records: xr.Dataset, tmp_path: Path
) -> None:
    spoilt = records.copy(deep=True)
    spoilt["stress"][records["split"].values == "test"] *= 2.0
    spoilt["stress"][records["split"].values == "validation"] *= 1.5
    for name, ds in (("honest", records), ("spoilt", spoilt)):
        LSTM.train(TrainingRequest(ds, tmp_path / name, epochs=3))
    honest, other = losses(tmp_path / "honest"), losses(tmp_path / "spoilt")
    assert [training for training, _ in honest] == [training for training, _ in other]
    assert honest != other


def test_a_killed_run_resumes_bit_for_bit(records: xr.Dataset, tmp_path: Path) -> None:
    killed = tmp_path / "killed"
    file = write_records(few(records), tmp_path / "few.nc")
    command = [sys.executable, "-c", RUN, str(file), str(killed), str(EPOCHS)]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, env=environment)
    while not (killed / TRAINING_FILE).exists() and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert 1 <= len(losses(killed)) < EPOCHS
    assert not (killed / WEIGHTS_FILE).exists()
    with open_records(file) as lazy:
        for folder in (killed, tmp_path / "whole"):
            MLSTM.train(TrainingRequest(lazy, folder, epochs=EPOCHS))
    assert losses(killed) == losses(folder)
    assert (killed / WEIGHTS_FILE).read_bytes() == (folder / WEIGHTS_FILE).read_bytes()


def test_same_seed_gives_the_same_weights_and_another_does_not(
    records: xr.Dataset, tmp_path: Path
) -> None:
    weights = []
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        request = TrainingRequest(records, tmp_path / name, seed=seed, epochs=2)
        weights.append((MLSTM.train(request) / WEIGHTS_FILE).read_bytes())
    assert weights[0] == weights[1] != weights[2]


def test_training_leaves_the_global_random_numbers_alone(
    records: xr.Dataset, tmp_path: Path
) -> None:
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    MLSTM.train(TrainingRequest(records, tmp_path, epochs=1))
    assert torch.equal(torch.rand(3), expected)


def test_data_larger_than_memory_train_as_well(
    records_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_records(records_file) as records:
        resident = MLSTM.train(TrainingRequest(records, tmp_path / "resident", epochs=5))
        monkeypatch.setattr(recurrent_records, "RESIDENT_BYTES", 0)
        streamed = MLSTM.train(TrainingRequest(records, tmp_path / "streamed", epochs=5))
    # The order of the windows differs, and nothing else.
    assert losses(streamed)[-1][0] == pytest.approx(losses(resident)[-1][0], rel=0.5)
    assert losses(streamed)[-1][0] < 0.9 * losses(streamed)[0][0]


def test_requests_that_do_not_fit_are_refused(records: xr.Dataset, tmp_path: Path) -> None:
    request = TrainingRequest(records, tmp_path, epochs=1)
    short = records.isel(step=slice(0, 20))
    without = records.isel(path=records["split"].values != "validation")
    for error, named, wrong in (
        (ConfigurationError, "reference, paper", replace(request, preset="fast")),
        (ConfigurationError, "device 'abacus'", replace(request, device="abacus")),
        (ConfigurationError, "epochs is 0", replace(request, epochs=0)),
        (ConfigurationError, "budget is -1", replace(request, seconds=-1.0)),
        (ConfigurationError, "longer paths", replace(request, records=short)),
        (RegistryError, "validation", replace(request, records=without)),
        (ModelError, "grading_index", replace(request, records=records.drop_vars("grading_index"))),
    ):
        with pytest.raises(error, match=named):
            MLSTM.train(wrong)
    assert not any(tmp_path.iterdir())
