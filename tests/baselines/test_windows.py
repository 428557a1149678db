"""Windows in memory and windows read from a file are the same windows."""

import torch
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.baselines.recurrent_network import Scaling
from granbench.baselines.recurrent_records import fit_scaling, window_source
from granbench.baselines.training.batches import ResidentBatches, StreamedBatches
from granbench.records import open_records

CPU = torch.device("cpu")


def test_streamed_windows_equal_resident_ones(records: xr.Dataset, records_file: str) -> None:
    scaling = Scaling()
    fit_scaling(scaling, records, lag=1)
    resident = window_source(records, scaling, 20, CPU)
    with open_records(records_file) as lazy:
        streamed = window_source(lazy, scaling, 20, CPU, resident_bytes=0)
        assert isinstance(resident, ResidentBatches)
        assert isinstance(streamed, StreamedBatches)
        assert resident.item_count == streamed.item_count == records.sizes["path"] * 21
        order = torch.randperm(resident.item_count, generator=torch.Generator().manual_seed(0))
        pairs = zip(
            resident.batches(order[:100], 30), streamed.batches(order[:100], 30), strict=True
        )
        for one, other in pairs:
            for a, b in zip(one, other, strict=True):
                torch.testing.assert_close(a, b)


def test_scaling_of_a_file_equals_that_of_memory(records: xr.Dataset, records_file: str) -> None:
    scalings = Scaling(), Scaling()
    fit_scaling(scalings[0], records, lag=10)
    with open_records(records_file) as lazy:
        fit_scaling(scalings[1], lazy, lag=10)
    for name, buffer in scalings[0].named_buffers():
        torch.testing.assert_close(buffer, dict(scalings[1].named_buffers())[name])


def test_a_window_ends_where_the_record_says(records: xr.Dataset) -> None:
    """Window 5 of path 2 starts at step 5; its targets are the states at steps 6 to 25."""
    scaling = Scaling()
    source = window_source(records, scaling, 20, CPU)
    inputs, start, targets = next(source.batches(torch.tensor([2 * 21 + 5]), 1))
    path = records.isel(path=2)
    torch.testing.assert_close(targets[0, :, :3].numpy(), path["stress"].values[6:26])
    torch.testing.assert_close(start[0, 4].item(), float(path["void_ratio"][5]))
    increments = path["strain"].astype("float64").diff("step").astype("float32").values
    torch.testing.assert_close(inputs[0, :, 4:].numpy(), increments[5:25])
    past = abs(increments[:5].astype("float64")).sum(axis=0)
    torch.testing.assert_close(inputs[0, 0, 1:4].double(), torch.from_numpy(past))


@settings(deadline=None)
@given(
    records_count=st.integers(1, 20),
    items=st.integers(1, 7),
    together=st.integers(1, 6),
    seed=st.integers(0, 5),
)
def test_streamed_order_has_every_item_once_and_reads_every_record_once(
    records_count: int, items: int, together: int, seed: int
) -> None:
    source = StreamedBatches(
        list(range(records_count * items)),
        lambda batch: (torch.tensor(batch),),
        CPU,
        items_per_record=items,
        records_together=together,
    )
    order = source.shuffled(torch.Generator().manual_seed(seed))
    assert order.sort().values.tolist() == list(range(records_count * items))
    groups = [set((part // items).tolist()) for part in order.split(together * items)]
    assert sum(map(len, groups)) == records_count
