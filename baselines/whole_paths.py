"""Networks that map strain increments to stress, trained on whole paths.

An architecture is a configuration and a network that runs its weights in two ways: `forward` along
whole paths, for training, and `advance` by one step, for the material cell. The rest is here:
scaling, training items, loss and cell. The memory of the material is in the hidden state, which
starts at zero; the stress is computed from the hidden state alone.
"""

import abc
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import torch
import xarray as xr
from pydantic.dataclasses import dataclass as validated_dataclass
from torch import Tensor, nn

from granbench.baselines.configuration import SETTINGS, NetworkConfiguration
from granbench.baselines.network_baseline import NetworkBaseline
from granbench.baselines.training.batches import Batch, BatchSource, ResidentBatches
from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.data.adapters import history_of
from granbench.tensors import COMPONENT_ORDERS, component_order

Order = Literal["principal", "plane", "full"]
Output = Literal["absolute", "change"]
assert set(get_args(Order)) == set(COMPONENT_ORDERS)


@validated_dataclass(frozen=True, config=SETTINGS)
class PathConfiguration(NetworkConfiguration):
    """Settings that every network on whole paths has.

    Parameters
    ----------
    order : component order of strain and stress, that of the training records

    Notes
    -----
    A subclass may declare a field `output`: the network gives the stress (`absolute`, the default)
    or its change since the start of the path (`change`).
    """

    order: Order = "plane"
    output = "absolute"

    @property
    def components(self) -> int:
        """Number of strain and stress components."""
        return len(COMPONENT_ORDERS[self.order])

    def target(self, stress: Tensor) -> Tensor:
        """The output that belongs to stresses (path, step, component) from the start, Pa."""
        return stress if self.output == "absolute" else stress - stress[:, :1]


class PathNetwork(nn.Module, abc.ABC):
    """Standardised strain increments to standardised stress, or change of stress.

    Means and standard deviations are buffers, so that they are saved with the weights.

    Attributes
    ----------
    configuration : of the architecture
    memory : width of the hidden state of one path, all layers together
    """

    configuration: Any
    memory: int
    increment_scale: Tensor
    stress_mean: Tensor
    stress_scale: Tensor

    def __init__(self, configuration: PathConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        count = configuration.components
        for name in ("increment_scale", "stress_scale"):
            self.register_buffer(name, torch.ones(count))
        self.register_buffer("stress_mean", torch.zeros(count))

    @abc.abstractmethod
    def forward(self, increments: Tensor) -> Tensor:
        """Standardised stress (path, step, component) after each of the increments."""

    def advance(self, increment: Tensor, hidden: Tensor) -> tuple[Tensor, Tensor]:
        """One step with the same weights.

        Parameters
        ----------
        increment : (point, component), standardised
        hidden : (point, `memory`)

        Returns
        -------
        standardised stress (point, component); hidden state after the step (point, `memory`)
        """
        raise NotImplementedError(
            f"{type(self).__name__} must define `advance`, or a `step_module` of its own"
        )

    def step_module(self) -> nn.Module:
        """The step of the cell: from strain increment and hidden state in rows, see `_Step`.

        An architecture may return a faster equivalent of `advance`.
        """
        return _Step(self)

    def fit_scaling(self, strain: Tensor, stress: Tensor) -> None:
        """Set means and standard deviations from records (path, step, component).

        Increments are only divided, so that zero strain stays zero.
        """
        self.increment_scale.copy_(_nonzero(strain.diff(dim=1).flatten(0, 1).std(dim=0)))
        target = self.configuration.target(stress).flatten(0, 1)
        self.stress_mean.copy_(target.mean(dim=0))
        self.stress_scale.copy_(_nonzero(target.std(dim=0)))

    def loss(self, batch: Batch) -> Tensor:
        """Mean squared error of standardised stress over all steps."""
        increments, stress = batch
        return (self(increments) - stress).square().mean()


def _nonzero(deviation: Tensor) -> Tensor:
    return torch.where(deviation > 0.0, deviation, 1.0)


class _Step(nn.Module):
    """One step of a network, in rows (unit, point)."""

    def __init__(self, network: PathNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, dstrain: Tensor, hidden: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Stress, or its change since the start, Pa, and the hidden state after, in parts."""
        network = self.network
        output, after = network.advance(dstrain.T / network.increment_scale, hidden.T)
        return (network.stress_mean + network.stress_scale * output).T, [after.T]


class PathCell(MaterialCell):
    """A trained `PathNetwork` as a material cell.

    Its state is stress and hidden state, and the initial stress if the output is a change from it.
    The first stress is that of the conditions; later stresses are not read from the state, so a
    true stress given during a path changes nothing.

    Parameters
    ----------
    network : trained; it is put into evaluation mode, and later changes of it have no effect
    name : shown on the leaderboard
    """

    def __init__(self, network: PathNetwork, name: str) -> None:
        self.network = network.eval().requires_grad_(False)
        self.name = name
        configuration = network.configuration
        self.order = configuration.order
        self.dtype = network.stress_mean.dtype
        widths = {"stress": configuration.components, "hidden": network.memory}
        self._from_start = configuration.output == "change"
        if self._from_start:
            widths["initial_stress"] = configuration.components
        self.layout = StateLayout.of(**widths)
        self._step = network.step_module()

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        stress = conditions.stress.to(self.dtype)
        hidden = self.layout["hidden"]
        slices = {"stress": stress}
        slices["hidden"] = stress.new_zeros(len(stress), hidden.stop - hidden.start)
        if self._from_start:
            slices["initial_stress"] = stress
        return self.layout.pack(**slices)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        rows = state.T
        stress, after = self._step(dstrain.T, rows[self.layout["hidden"]])
        if not self._from_start:
            return stress.T, torch.cat([stress, *after]).T
        start = rows[self.layout["initial_stress"]]
        stress = start + stress
        return stress.T, torch.cat([stress, *after, start]).T

    def parameters_count(self) -> int:
        """See `MaterialCell.parameters_count`."""
        return sum(parameter.numel() for parameter in self.network.parameters())


@dataclass(frozen=True)
class PathBaseline(NetworkBaseline[Any, Any]):
    """An architecture trained on whole paths; see `NetworkBaseline`.

    Parameters
    ----------
    configuration_type : subclass of `PathConfiguration`
    network_type : subclass of `PathNetwork`
    """

    configuration_type: type[PathConfiguration]
    network_type: type[PathNetwork]

    def check(self, records: xr.Dataset) -> None:
        """See `NetworkBaseline.check`; all records have strain and stress."""

    def fitted_to(self, configuration: PathConfiguration, records: xr.Dataset) -> PathConfiguration:
        """See `NetworkBaseline.fitted_to`: in the component order of the records."""
        order = component_order(records["component"].values)
        return replace(configuration, order=order)  # type: ignore[arg-type]

    def configuration_of(self, settings: dict[str, Any]) -> PathConfiguration:
        """See `NetworkBaseline.configuration_of`."""
        return self.configuration_type.of(settings)

    def network(self, configuration: PathConfiguration) -> PathNetwork:
        """See `NetworkBaseline.network`."""
        return self.network_type(configuration)

    def scale(self, network: PathNetwork, training: xr.Dataset) -> None:
        """See `NetworkBaseline.scale`."""
        history = history_of(training)
        network.fit_scaling(history.strain, history.stress)

    def source(self, network: PathNetwork, split: xr.Dataset, device: torch.device) -> BatchSource:
        """Whole paths."""
        history = history_of(split)
        scale, mean, deviation = (
            buffer.cpu().double()
            for buffer in (network.increment_scale, network.stress_mean, network.stress_scale)
        )
        increments = (history.strain.diff(dim=1) / scale).to(device, torch.float32)
        target = network.configuration.target(history.stress)
        stress = ((target[:, 1:] - mean) / deviation).to(device, torch.float32)
        return ResidentBatches(
            lambda paths: (increments[paths], stress[paths]), len(increments), device
        )

    def cell(self, network: PathNetwork) -> PathCell:
        """See `NetworkBaseline.cell`."""
        return PathCell(network, self.name)
