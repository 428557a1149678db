"""The training engine, on a network so small that every law shows in milliseconds."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor, nn

from granbench.baselines.training import Limits, Recipe, TrainingOutcome, engine, train
from granbench.baselines.training.batches import ResidentBatches
from granbench.baselines.training.history import read_history
from granbench.baselines.training.progress import TRAINING_FILE
from granbench.errors import ConfigurationError, ModelError


class Line(nn.Module):
    """y = a x + b."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(1, 1)
        nn.init.zeros_(self.layer.weight)
        nn.init.zeros_(self.layer.bias)

    def loss(self, batch: tuple[Tensor, ...]) -> Tensor:
        x, y = batch
        return (self.layer(x) - y).square().mean()


def source(slope: float, count: int = 64) -> ResidentBatches:
    x = torch.linspace(-1.0, 1.0, count)[:, None]
    y = slope * x + 0.5
    return ResidentBatches(lambda rows: (x[rows], y[rows]), count, torch.device("cpu"))


def run(
    folder: Path,
    *,
    epochs: int = 20,
    seed: int = 0,
    seconds: float | None = None,
    slope: float = 2.0,
    on_epoch: Callable | None = None,
    **recipe: object,
) -> TrainingOutcome:
    return train(
        Line(),
        source(slope),
        source(2.0),
        recipe=Recipe(**({"batch_size": 10, "learning_rate": 0.03} | recipe)),
        limits=Limits(epochs=epochs, seconds=seconds),
        seed=seed,
        folder=folder,
        fingerprint={"network": "line"},
        on_epoch=on_epoch,
    )


def losses(folder: Path) -> list[tuple[float, float]]:
    return [(report.training_loss, report.validation_loss) for report in read_history(folder)]


def test_training_recovers_the_line(tmp_path: Path) -> None:
    outcome = run(tmp_path, epochs=200)
    assert outcome.best_weights["layer.weight"].item() == pytest.approx(2.0, abs=1e-3)
    assert outcome.best_weights["layer.bias"].item() == pytest.approx(0.5, abs=1e-3)
    assert outcome.reason == "epochs"


def test_same_seed_gives_the_same_bits_and_another_seed_does_not(tmp_path: Path) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        run(tmp_path / name, seed=seed)
    assert losses(tmp_path / "a") == losses(tmp_path / "b")
    assert losses(tmp_path / "a") != losses(tmp_path / "c")


@settings(deadline=None, max_examples=15)
@given(stops=st.lists(st.integers(1, 19), max_size=3, unique=True))
def test_a_run_continued_anywhere_ends_with_the_same_bits(
    tmp_path_factory: pytest.TempPathFactory, stops: list[int]
) -> None:
    whole, pieces = tmp_path_factory.mktemp("whole"), tmp_path_factory.mktemp("pieces")
    expected = run(whole)
    for epochs in [*sorted(stops), 20]:
        outcome = run(pieces, epochs=epochs)
    assert losses(pieces) == losses(whole)
    for name, tensor in expected.best_weights.items():
        assert torch.equal(outcome.best_weights[name], tensor)


def test_an_epoch_that_was_cut_off_is_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "SAVE_EVERY_SECONDS", -1.0)

    def interrupt(report: object) -> None:
        if report.epoch == 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "cut", on_epoch=interrupt)
    assert len(losses(tmp_path / "cut")) == 7
    run(tmp_path / "cut")
    run(tmp_path / "whole")
    assert losses(tmp_path / "cut") == losses(tmp_path / "whole")


def test_rows_written_after_the_last_saved_epoch_are_dropped(tmp_path: Path) -> None:
    run(tmp_path, epochs=5)
    with (tmp_path / "history.csv").open("a") as table:
        table.write("6,1.0,1.0,1.0,1.0,1.0,1.0\n")
    run(tmp_path, epochs=7)
    run(tmp_path / "whole", epochs=7)
    assert losses(tmp_path) == losses(tmp_path / "whole")


def test_a_finished_run_does_nothing_more(tmp_path: Path) -> None:
    first = run(tmp_path)
    reports: list = []
    assert run(tmp_path, on_epoch=reports.append).progress == first.progress
    assert not reports


def test_patience_ends_a_run_and_the_best_weights_are_kept(tmp_path: Path) -> None:
    # The training split has another slope than the validation split: on its way from 0 to 4
    # the line passes the validation slope of 2, and then moves away from it.
    outcome = run(tmp_path, epochs=1000, slope=4.0, patience=5)
    assert outcome.reason == "patience"
    assert outcome.progress.epoch == outcome.progress.best_epoch + 5
    validation = [loss for _, loss in losses(tmp_path)]
    assert outcome.progress.best_loss == min(validation) < validation[-1]
    best = Line()
    best.load_state_dict(outcome.best_weights)
    everything = next(source(2.0).batches(torch.arange(64), 64))
    assert best.loss(everything).item() == pytest.approx(min(validation), rel=1e-6)


def test_budget_ends_a_run_and_counts_over_sessions(tmp_path: Path) -> None:
    outcome = run(tmp_path, epochs=10**6, seconds=0.2, patience=10**6)
    assert outcome.reason == "budget"
    reports: list = []
    run(tmp_path, epochs=10**6, seconds=0.2, patience=10**6, on_epoch=reports.append)
    assert not reports


def test_another_run_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    run(tmp_path)
    with pytest.raises(ConfigurationError, match="another seed"):
        run(tmp_path, seed=1)
    with pytest.raises(ConfigurationError, match="another recipe"):
        run(tmp_path, learning_rate=0.01)


def test_a_loss_that_is_not_finite_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no longer finite in epoch 1"):
        run(tmp_path, slope=math.nan)


@pytest.mark.parametrize("content", [b"", b"not safetensors", b"\xff" * 400])
def test_a_damaged_run_is_an_error_with_a_remedy(tmp_path: Path, content: bytes) -> None:
    run(tmp_path)
    (tmp_path / TRAINING_FILE).write_bytes(content)
    with pytest.raises(ModelError, match=r"training\.safetensors.*damaged"):
        run(tmp_path)


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelError, match="cannot be written"):
        run(tmp_path / "file" / "run")


@given(progress=st.floats(0.0, 1.5))
def test_cosine_rate_falls_from_first_to_last(progress: float) -> None:
    recipe = Recipe(schedule="cosine", learning_rate=1e-2, final_rate=1e-5)
    assert recipe.rate(0.0) == pytest.approx(1e-2)
    assert recipe.rate(1.0) == pytest.approx(1e-5)
    assert recipe.rate(progress) >= recipe.rate(progress + 0.1)


@pytest.mark.parametrize(
    "setting",
    [{"batch_size": 0}, {"epochs": 0}, {"patience": 0}, {"learning_rate": 0.0},
     {"final_rate": math.inf}, {"schedule": "linear"}],
)  # fmt: skip
def test_settings_out_of_range_are_refused(setting: dict) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(setting))):
        Recipe(**setting)


def test_a_one_cycle_rate_rises_to_its_peak_and_falls_to_its_end() -> None:
    recipe = Recipe(learning_rate=1e-2, schedule="one-cycle", final_rate=1e-6)
    rates = [recipe.rate(share / 100.0) for share in range(101)]
    peak = rates.index(max(rates))
    assert rates[0] == pytest.approx(4e-4)
    assert rates[peak] == pytest.approx(1e-2)
    assert peak == 30
    assert rates[-1] == pytest.approx(1e-6)
    assert rates[:peak] == sorted(rates[:peak])
    assert rates[peak:] == sorted(rates[peak:], reverse=True)


def test_a_long_gradient_is_cut(tmp_path: Path) -> None:
    # Cut far below Adam's epsilon a gradient moves nothing; the uncut one has a norm near 2.
    still = run(tmp_path / "cut", largest_gradient=1e-14)
    assert still.best_weights["layer.weight"].abs().item() < 1e-3
    free, loose = run(tmp_path / "free"), run(tmp_path / "loose", largest_gradient=1e3)
    assert torch.equal(free.best_weights["layer.weight"], loose.best_weights["layer.weight"])
    with pytest.raises(ConfigurationError, match="largest_gradient"):
        Recipe(largest_gradient=0.0)
