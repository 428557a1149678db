"""Sources of training items: tensors on the device, or a dataset that is read in parts."""

import abc
from collections.abc import Callable, Iterator

import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

Batch = tuple[Tensor, ...]
"""Tensors whose first dimension is the item, in the order that the loss of the network expects."""


class BatchSource(abc.ABC):
    """Items of one split, drawn in any order.

    Attributes
    ----------
    item_count : number of items
    """

    item_count: int

    @abc.abstractmethod
    def shuffled(self, generator: torch.Generator) -> Tensor:
        """Every item once, in random order: numbers (item,), int64."""

    @abc.abstractmethod
    def batches(self, order: Tensor, batch_size: int) -> Iterator[Batch]:
        """The items numbered in `order` (item,), int64, in batches; the last may be smaller."""


class ResidentBatches(BatchSource):
    """Items gathered by number from tensors that stay on the device.

    Parameters
    ----------
    gather : maps item numbers (item,), on `device`, to their batch
    item_count : number of items
    device : where the tensors are
    """

    def __init__(
        self, gather: Callable[[Tensor], Batch], item_count: int, device: torch.device
    ) -> None:
        self._gather = gather
        self._device = device
        self.item_count = item_count

    def shuffled(self, generator: torch.Generator) -> Tensor:
        """See `BatchSource.shuffled`."""
        return torch.randperm(self.item_count, generator=generator)

    def batches(self, order: Tensor, batch_size: int) -> Iterator[Batch]:
        """See `BatchSource.batches`."""
        for numbers in order.to(self._device).split(batch_size):
            yield self._gather(numbers)


class StreamedBatches(BatchSource):
    """Items read from a torch dataset batch by batch, for data larger than memory.

    Items that are stored together are drawn together: the order is random among groups of records
    and among the items of a group, but every record is read once per epoch.

    Parameters
    ----------
    dataset : sized torch dataset, the items of one record next to each other
    collate : makes a batch of a list of its items
    device : where batches are moved to
    items_per_record : items that are read together
    records_together : records whose items are mixed, as many as the dataset keeps in memory
    """

    def __init__(
        self,
        dataset: Dataset,
        collate: Callable[[list], Batch],
        device: torch.device,
        *,
        items_per_record: int,
        records_together: int,
    ) -> None:
        self._dataset = dataset
        self._collate = collate
        self._device = device
        self._items_per_record = items_per_record
        self._records_together = records_together
        self.item_count = len(dataset)  # type: ignore[arg-type]

    def shuffled(self, generator: torch.Generator) -> Tensor:
        """See `BatchSource.shuffled`."""
        records = torch.randperm(self.item_count // self._items_per_record, generator=generator)
        within = torch.arange(self._items_per_record)
        parts = []
        for group in records.split(self._records_together):
            items = (group[:, None] * self._items_per_record + within).flatten()
            parts.append(items[torch.randperm(len(items), generator=generator)])
        return torch.cat(parts)

    def batches(self, order: Tensor, batch_size: int) -> Iterator[Batch]:
        """See `BatchSource.batches`."""
        numbers = [part.tolist() for part in order.split(batch_size)]
        for batch in DataLoader(
            self._dataset, batch_sampler=numbers, collate_fn=self._collate, num_workers=0
        ):
            yield tuple(tensor.to(self._device) for tensor in batch)
