"""What the formulas are written in says the same of tensors and of NumPy's arrays."""

import math

import numpy as np
import pytest
import torch

from granbench.models import arrays

NUMBERS = np.array([0.25, 1.0, 3.0, math.nan])
OTHERS = np.array([2.0, 0.5, 3.0, 1.0])
MASK = np.array([True, False, True, False])

CALLS = {
    "exp": lambda x, y, mask: arrays.exp(x),
    "expm1": lambda x, y, mask: arrays.expm1(x),
    "log": lambda x, y, mask: arrays.log(x),
    "log1p": lambda x, y, mask: arrays.log1p(x),
    "sqrt": lambda x, y, mask: arrays.sqrt(x),
    "power": lambda x, y, mask: arrays.power(x, y),
    "power, number": lambda x, y, mask: arrays.power(x, 0.2),
    "addcmul": lambda x, y, mask: arrays.addcmul(x, x, y),
    "addcmul, minus": lambda x, y, mask: arrays.addcmul(x, x, y, value=-1.0),
    "addcmul, thrice": lambda x, y, mask: arrays.addcmul(x, x, y, value=3.0),
    "contracted": lambda x, y, mask: arrays.contracted(y[:2], x.reshape(2, 2), y.reshape(2, 2)),
    "at_least": lambda x, y, mask: arrays.at_least(x, 0.5),
    "between": lambda x, y, mask: arrays.between(x, 0.5, 2.0),
    "minimum": lambda x, y, mask: arrays.minimum(x, y),
    "maximum": lambda x, y, mask: arrays.maximum(x, y),
    "where": lambda x, y, mask: arrays.where(mask, x, y),
    "where, numbers": lambda x, y, mask: arrays.where(mask, x, -1.0),
    "isfinite": lambda x, y, mask: arrays.isfinite(x),
    "isnan": lambda x, y, mask: arrays.isnan(x),
    "full_like": lambda x, y, mask: arrays.full_like(x, math.inf),
    "zeros_like": lambda x, y, mask: arrays.zeros_like(x),
    "ones_like": lambda x, y, mask: arrays.ones_like(x),
    "stack": lambda x, y, mask: arrays.stack([x, y]),
    "cat": lambda x, y, mask: arrays.cat([x[None], y[None]]),
    "places": lambda x, y, mask: arrays.places(mask),
    "replaced": lambda x, y, mask: arrays.replaced(x, arrays.places(mask), y[:2]),
    "detached": lambda x, y, mask: arrays.detached(x),
}


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", CALLS)
def test_both_kinds_get_the_same(name, dtype):
    given = NUMBERS.astype(dtype), OTHERS.astype(dtype), MASK
    in_numpy = CALLS[name](*given)
    in_torch = CALLS[name](*map(torch.from_numpy, given))
    assert isinstance(in_torch, torch.Tensor)
    assert isinstance(in_numpy, np.ndarray)
    assert in_numpy.dtype == in_torch.numpy().dtype
    np.testing.assert_allclose(in_numpy, in_torch.numpy(), rtol=4.0 * np.finfo(dtype).eps)


def test_what_is_replaced_is_a_copy():
    for x in (NUMBERS.copy(), torch.from_numpy(NUMBERS.copy())):
        arrays.replaced(x, arrays.places(x == 1.0), x[:1])
        assert float(x[1]) == 1.0


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_bounds_of_a_type_are_known_of_both(dtype):
    x = torch.zeros(1, dtype=dtype)
    assert arrays.rounding_unit(x) == arrays.rounding_unit(x.numpy()) == torch.finfo(dtype).eps
    assert arrays.smallest_square(x) == arrays.smallest_square(x.numpy()) > 0.0
    assert math.isfinite(1.0 / arrays.smallest_square(x))


def test_gradients_are_wanted_of_what_requires_them():
    leaf = torch.zeros(1, requires_grad=True)
    assert arrays.gradients_wanted(torch.zeros(1), leaf)
    assert not arrays.gradients_wanted(torch.zeros(1), NUMBERS)
    with torch.no_grad():
        assert not arrays.gradients_wanted(leaf)
