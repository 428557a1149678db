import numpy as np
import pytest
from small_cells import Fragile, Oracle, Persistence, secant

from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scoring import score
from granbench.data.normalisation import Normalisation
from granbench.errors import ConfigurationError
from granbench.plotting.predictions import horizon_figure, prediction_figure, typical_paths
from granbench.plotting.style import model_styles


@pytest.fixture
def runs(records):
    scored = evaluated(records)
    cells = {"secant": secant(), "oracle": Oracle(scored), "persistence": Persistence()}
    return {name: predict({0: cell}, scored, ["window", "rollout"]) for name, cell in cells.items()}


def lines_with(axis, colour):
    return [line for line in axis.lines if line.get_color() == colour]


def test_truth_is_dots_and_models_are_lines(records, runs):
    paths = typical_paths(records, runs["secant"])
    figure = prediction_figure(records, runs, paths)
    axes = figure.axes
    assert len(axes) == 3 * len(paths)
    styles = model_styles(runs)
    for row in range(3):
        for axis in axes[row * len(paths) : (row + 1) * len(paths)]:
            (dots,) = [line for line in axis.lines if line.get_linestyle() == "None"]
            assert dots.get_marker() == "o"
            (oracle,) = lines_with(axis, styles["oracle"].colour)
            np.testing.assert_allclose(oracle.get_ydata(), dots.get_ydata(), rtol=1e-3)
            # Persistence has no void ratio to draw.
            expected = 0 if row == 2 else 1
            assert len(lines_with(axis, styles["persistence"].colour)) == expected
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["measured (DEM)", "secant", "oracle", "persistence"]
    assert all(axis.get_ylabel().endswith("]") for axis in axes[:: len(paths)])


def test_typical_paths_are_one_of_each_family_and_of_median_error(records, runs):
    paths = typical_paths(records, runs["persistence"])
    families = [path.rpartition("/")[2].split("-", 1)[1] for path in paths]
    assert families == ["constant-p", "constant-sigma3", "cyclic", "random-strain"]
    with pytest.raises(ConfigurationError, match="no path of split 'train'"):
        typical_paths(records, runs["secant"], split="train")


def test_a_broken_run_ends_where_it_broke(records):
    scored = evaluated(records)
    broken = predict({0: Fragile(0.1, raises=False)}, scored, ["rollout"])
    path = [str(scored["path_id"].values[0])]
    figure = prediction_figure(records, {"fragile": broken}, path)
    (line,) = lines_with(figure.axes[0], model_styles(["fragile"])["fragile"].colour)
    series = np.asarray(line.get_ydata())
    assert np.isnan(series[-1]) and np.isfinite(series[0])


def test_error_against_horizon_shows_the_floor_for_whole_paths_only(records, runs):
    normalisation = Normalisation.from_training(records)
    curves = {
        name: score(run, evaluated(records), normalisation).curves for name, run in runs.items()
    }
    figure = horizon_figure(curves, floor=1e-3)
    window, rollout = figure.axes
    assert window.get_yscale() == rollout.get_yscale() == "log"
    names = {line.get_label() for line in window.lines}
    assert names == {"secant", "persistence"}  # the oracle's zero has no logarithm
    assert {line.get_label() for line in rollout.lines} == names | {"replicate scatter"}
    with pytest.raises(ConfigurationError, match="no model has an error curve"):
        horizon_figure(curves, split="ood-wind")


def test_what_is_not_there_cannot_be_drawn(records, runs):
    paths = typical_paths(records, runs["secant"])
    with pytest.raises(ConfigurationError, match="no path 'nowhere'"):
        prediction_figure(records, runs, ["nowhere"])
    with pytest.raises(ConfigurationError, match="lack protocol 'noise-0.2'"):
        prediction_figure(records, runs, paths, protocol="noise-0.2")
    with pytest.raises(ConfigurationError, match="at least one"):
        prediction_figure(records, {}, paths)
