"""The recurrent baselines of Table 2.4: training windows and material cell."""

from typing import Any

import torch
import xarray as xr

from granbench.baselines.network_baseline import NetworkBaseline
from granbench.baselines.recurrent_cell import RecurrentCell
from granbench.baselines.recurrent_network import RecurrentConfiguration, RecurrentNetwork
from granbench.baselines.recurrent_records import check_records, fit_scaling, window_source
from granbench.baselines.training import Recipe
from granbench.baselines.training.batches import BatchSource
from granbench.errors import ConfigurationError

REFERENCE_RECIPE = Recipe(learning_rate=3e-3, schedule="cosine", epochs=30, patience=30)
"""Recipe of both networks, for a fair comparison. On `dem-triaxial` 1.0.0 the validation loss of
the mLSTM is the same (3.1e-4) after 20, 30 or 200 epochs; later ones only lower the training loss.
The patience lets the learning rate fall to its end."""


class RecurrentBaseline(NetworkBaseline[RecurrentConfiguration, RecurrentNetwork]):
    """An LSTM or mLSTM, trained on windows; see `NetworkBaseline`."""

    def check(self, records: xr.Dataset) -> None:
        """See `NetworkBaseline.check`."""
        check_records(records)

    def fitted_to(
        self, configuration: RecurrentConfiguration, records: xr.Dataset
    ) -> RecurrentConfiguration:
        """See `NetworkBaseline.fitted_to`; paths must be longer than a window."""
        if records.sizes["step"] <= configuration.window:
            raise ConfigurationError(
                f"{records.attrs.get('dataset', 'the dataset')}: its paths have "
                f"{records.sizes['step'] - 1} steps, but training windows have "
                f"{configuration.window}; use a dataset with longer paths"
            )
        return configuration

    def configuration_of(self, settings: dict[str, Any]) -> RecurrentConfiguration:
        """See `NetworkBaseline.configuration_of`."""
        return RecurrentConfiguration.of(settings)

    def network(self, configuration: RecurrentConfiguration) -> RecurrentNetwork:
        """See `NetworkBaseline.network`."""
        return RecurrentNetwork(configuration)

    def scale(self, network: RecurrentNetwork, training: xr.Dataset) -> None:
        """See `NetworkBaseline.scale`."""
        fit_scaling(network.scaling, training, network.configuration.change_lag)

    def source(
        self, network: RecurrentNetwork, split: xr.Dataset, device: torch.device
    ) -> BatchSource:
        """Windows of the configured length, taken at every step."""
        return window_source(split, network.scaling, network.configuration.window, device)

    def cell(self, network: RecurrentNetwork) -> RecurrentCell:
        """See `NetworkBaseline.cell`."""
        return RecurrentCell(network, self.name)
