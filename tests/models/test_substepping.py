"""Error-controlled integration, on equations whose solutions are known."""

import itertools
import math
from typing import NamedTuple

import pytest
import torch
from torch import Tensor

from granbench.models.substepping import (
    LARGEST_FACTOR,
    LEAST_FACTOR,
    Attempt,
    Substepping,
    runge_kutta,
    substepped,
)


class Decay(NamedTuple):
    """x' = -speed (x - load) under a load that grows with the strain; all (point,)."""

    speed: Tensor


class Relaxation:
    """A scalar state that runs after the strain: d state/d strain = -speed (state - strain).

    Its solution from x_0 at strain 0 is strain - 1/speed + (x_0 + 1/speed) exp(-speed strain). The
    second row of the state is the strain so far. Counts how often it is asked, for how many points.
    """

    def __init__(self, *, never: float = math.inf) -> None:
        self.never = never
        self.asked: list[int] = []

    def advance(self, dstrain: Tensor, state: Tensor, constants: Decay) -> Attempt:
        self.asked.append(state.shape[1])
        (strain,) = dstrain
        begin, before = state

        def rate(time: float, x: Tensor) -> Tensor:
            return -constants.speed * (x - (before + time * strain)) * strain

        step = runge_kutta(rate, begin[None])
        error = step.error[0].abs().detach()
        error = torch.where(before + strain > self.never, torch.inf, error)
        return Attempt(torch.stack([step.end[0], before + strain]), error)


def numbers(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def start(points: int, value: float = 1.0) -> Tensor:
    return torch.stack([torch.full((points,), value), torch.zeros(points)]).double()


def solution(strain: Tensor, speed: Tensor, value: float = 1.0) -> Tensor:
    return strain - 1.0 / speed + (value + 1.0 / speed) * torch.exp(-speed * strain)


SPEEDS = numbers(0.01, 1.0, 30.0, 1e3)
"""Increments that take from one substep to hundreds."""


# The Runge-Kutta pair.


def swing(time: float, state: Tensor) -> Tensor:
    """x' = y + t, y' = -x (1 + t): smooth, not autonomous, of no special form."""
    x, y = state
    return torch.stack([y + time, -x * (1.0 + time)])


def test_the_pair_is_of_orders_two_and_three():
    begin = numbers(1.0, 0.3)[:, None]

    def along(steps: int, of_order: int) -> Tensor:
        state = begin
        for k in range(steps):
            # A piece of pseudo-time k/steps ... (k + 1)/steps has rates that are as much smaller.
            def rate(time: float, x: Tensor, k: int = k) -> Tensor:
                return swing((k + time) / steps, x) / steps

            step = runge_kutta(rate, state)
            state = step.end if of_order == 3 else step.end - step.error
        return state

    exact = along(4096, 3)
    for order in (2, 3):
        errors = [float((along(steps, order) - exact).norm()) for steps in (8, 16, 32, 64)]
        for coarse, fine in itertools.pairwise(errors):
            assert math.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_stages_are_where_the_rates_were_taken():
    begin = numbers(1.0, 0.3)[:, None]
    step = runge_kutta(swing, begin)
    for time, stage, rate in zip((0.0, 1.0, 0.5), step.stages, step.rates, strict=True):
        assert torch.equal(swing(time, stage), rate)


def test_a_constant_rate_has_no_error():
    step = runge_kutta(lambda _, x: torch.full_like(x, 0.75), numbers(2.0)[:, None])
    assert float(step.end) == 2.75
    assert float(step.error) == 0.0


# Error control.


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_errors_stay_below_the_tolerance_whatever_the_speed(tolerance):
    """Pieces of an equation that forgets: what each adds fades away, so their sum stays small."""
    model, strain = Relaxation(), torch.full((4,), 2.0).double()
    after = substepped(model.advance, strain[None], start(4), Decay(SPEEDS), Substepping(tolerance))
    # The tolerance bounds the difference from order two; the result is of order three.
    torch.testing.assert_close(after[0], solution(strain, SPEEDS), rtol=0.0, atol=tolerance)
    torch.testing.assert_close(after[1], strain, rtol=1e-14, atol=0.0)


def test_a_sharper_tolerance_pays():
    errors, costs = [], []
    for tolerance in (1e-3, 1e-5, 1e-7):
        model, strain = Relaxation(), numbers(2.0)
        after = substepped(
            model.advance, strain[None], start(1), Decay(numbers(5.0)), Substepping(tolerance)
        )
        errors.append(float((after[0] - solution(strain, numbers(5.0))).abs()))
        costs.append(len(model.asked))
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2]
    # Pieces shrink with the cube root of the tolerance: 100^(1/3) = 4.6 times as many.
    assert costs[2] / costs[1] == pytest.approx(100.0 ** (1.0 / 3.0), rel=0.3)


def test_an_increment_that_meets_the_tolerance_is_one_attempt():
    model = Relaxation()
    constants = Decay(numbers(1e-3, 1e-2))
    with torch.no_grad():
        after = substepped(
            model.advance, numbers(0.1, 0.1)[None], start(2), constants, Substepping()
        )
    assert model.asked == [2]
    assert torch.equal(after, model.advance(numbers(0.1, 0.1)[None], start(2), constants).state)


def test_only_points_that_missed_the_tolerance_go_on():
    model, speeds = Relaxation(), numbers(0.01, 0.01, 1e3)
    substepped(model.advance, torch.ones(1, 3).double(), start(3), Decay(speeds), Substepping())
    assert model.asked[0] == 3
    assert set(model.asked[1:]) == {1}


@torch.no_grad()
def test_points_do_not_affect_each_other():
    """A batch is its points one by one, to the last bit: no point's pieces depend on another's."""
    generator = torch.Generator().manual_seed(0)
    speeds = 10.0 ** (4.0 * torch.rand(23, generator=generator, dtype=torch.float64) - 2.0)
    strain = torch.rand(1, 23, generator=generator, dtype=torch.float64)
    model, state = Relaxation(), start(23)
    together = substepped(model.advance, strain, state, Decay(speeds), Substepping())
    for k in range(23):
        one = slice(k, k + 1)
        alone = substepped(
            model.advance, strain[:, one], state[:, one], Decay(speeds[one]), Substepping()
        )
        assert torch.equal(together[:, one], alone)


@torch.no_grad()
def test_constants_that_all_points_share_need_no_copy_for_each():
    strain = torch.tensor([[0.5, 1.0, 2.0]], dtype=torch.float64)
    shared, each = (
        substepped(Relaxation().advance, strain, start(3), constants, Substepping())
        for constants in (
            Decay(torch.tensor(20.0).double()),
            Decay(torch.full((3,), 20.0).double()),
        )
    )
    assert torch.equal(shared, each)


# What cannot be followed.


@pytest.mark.parametrize("with_gradients", [False, True])
def test_a_point_that_cannot_be_followed_is_nan_and_leaves_the_others_alone(with_gradients):
    # Nothing exists beyond a strain of one.
    strain = torch.tensor([[0.9, 1.5, 0.5]], dtype=torch.float64, requires_grad=with_gradients)
    constants = Decay(numbers(100.0, 100.0, 0.01))
    after = substepped(Relaxation(never=1.0).advance, strain, start(3), constants, Substepping())
    assert torch.isnan(after[:, 1]).all()
    others = [0, 2]
    expected = solution(strain[0, others], constants.speed[others])
    torch.testing.assert_close(after[0, others], expected, rtol=0.0, atol=3e-4)
    if with_gradients:
        (gradient,) = torch.autograd.grad(after[0, others].sum(), strain)
        assert torch.isfinite(gradient[0, others]).all()
        assert float(gradient[0, 1]) == 0.0


@pytest.mark.parametrize("entry", [math.nan, math.inf])
def test_an_increment_that_is_no_number_is_not_tried_for_long(entry):
    model = Relaxation()
    after = substepped(
        model.advance,
        numbers(entry, 0.1)[None],
        start(2),
        Decay(numbers(1.0, 0.01)),
        Substepping(),
    )
    assert torch.isnan(after[:, 0]).all()
    assert torch.isfinite(after[:, 1]).all()
    assert model.asked == [2]


@torch.no_grad()
def test_most_is_how_many_attempts_a_point_has():
    strain, constants = torch.ones(1, 1).double(), Decay(numbers(1e3))
    model = Relaxation()
    substepped(model.advance, strain, start(1), constants, Substepping())
    needed = len(model.asked) - 1  # the first is the whole increment
    assert needed > 100
    for most, followed in ((needed, True), (needed - 1, False)):
        settings = Substepping(most=most)
        model = Relaxation()
        after = substepped(model.advance, strain, start(1), constants, settings)
        assert bool(torch.isfinite(after).all()) is followed
        assert len(model.asked) == 1 + most


@torch.no_grad()
def test_smallest_is_the_piece_that_is_never_gone_below():
    """Where nothing can be done the pieces shrink by ten each time, and that ends."""
    model = Relaxation(never=-1.0)
    settings = Substepping(smallest=1e-6)
    after = substepped(model.advance, numbers(1.0)[None], start(1), Decay(numbers(1.0)), settings)
    assert torch.isnan(after).all()
    # Of sizes 1 and then 1e-1 ... 1e-6; which of the last two rounding keeps is open.
    tried = math.log(settings.smallest) / math.log(LEAST_FACTOR)
    assert len(model.asked) - 1 in (tried - 1, tried, tried + 1)


@torch.no_grad()
def test_pieces_grow_no_faster_than_they_may():
    """A steep beginning, then nothing: sizes quadruple until the end is reached."""
    sizes = []

    def advance(dstrain: Tensor, state: Tensor, constants: Decay) -> Attempt:
        steep = (state[0] == 0.0) & (dstrain[0] > 1e-4)
        sizes.append(float(dstrain))
        return Attempt(state + dstrain, torch.where(steep, 1.0, 0.0).double())

    substepped(advance, torch.ones(1, 1).double(), start(1, 0.0)[:1], Decay(numbers(1.0)),
               Substepping())  # fmt: skip
    grown = [after / before for before, after in itertools.pairwise(sizes)]
    first = sizes.index(min(sizes))
    assert grown[first:-1] == pytest.approx([LARGEST_FACTOR] * len(grown[first:-1]))
    assert sum(sizes[first:]) == pytest.approx(1.0, rel=1e-14)


# Gradients.


def test_gradients_are_those_of_the_solution():
    """With respect to strain, state and constants, of points in one piece and in hundreds."""
    strain = torch.full((1, 4), 0.8, dtype=torch.float64, requires_grad=True)
    state = start(4).requires_grad_()
    speeds = SPEEDS.clone().requires_grad_()
    settings = Substepping(tolerance=1e-7)
    after = substepped(Relaxation().advance, strain, state, Decay(speeds), settings)
    found = torch.autograd.grad(after[0].sum(), (strain, state, speeds))
    exact = solution(strain[0], speeds) + (state[0] - 1.0) * torch.exp(-speeds * strain[0])
    expected = torch.autograd.grad(exact.sum(), (strain, state, speeds), materialize_grads=True)
    for mine, theirs in zip(found, expected, strict=True):
        # That the strain so far starts at zero is not in the formula.
        mine, theirs = (value[0] if value.ndim == 2 else value for value in (mine, theirs))
        torch.testing.assert_close(mine, theirs, rtol=1e-4, atol=1e-5)


def test_gradients_are_those_of_the_accepted_pieces():
    """The pieces are constants of the derivative: finite differences with their sizes held."""
    strain, constants = numbers(0.7, 0.8, 0.9)[None], Decay(numbers(3.0, 0.001, 30.0))
    sizes: dict[int, list[float]] = {}
    model = Relaxation()

    def noted(dstrain: Tensor, state: Tensor, c: Decay) -> Attempt:
        attempt = model.advance(dstrain, state, c)
        if not torch.is_grad_enabled():
            for share, speed, ok in zip(dstrain[0], c.speed, attempt.error <= 3e-4, strict=True):
                if ok:
                    sizes.setdefault(float(speed), []).append(float(share))
        return attempt

    variable = strain.clone().requires_grad_()
    after = substepped(noted, variable, start(3), constants, Substepping())
    (gradient,) = torch.autograd.grad(after[0].sum(), variable)

    for k, speed in enumerate(constants.speed):
        total = strain[0, k]
        shares = [size / float(total) for size in sizes[float(speed)]]
        assert sum(shares) == pytest.approx(1.0, rel=1e-12)

        def end(whole: Tensor, shares=shares, speed=speed) -> float:
            state = start(1)
            for share in shares:
                state = model.advance(
                    (share * whole).reshape(1, 1), state, Decay(speed[None])
                ).state
            return float(state[0])

        assert float(after[0, k].detach()) == pytest.approx(end(total), rel=1e-13)
        difference = (end(total + 1e-6) - end(total - 1e-6)) / 2e-6
        assert float(gradient[0, k]) == pytest.approx(difference, rel=1e-6, abs=1e-8)


def test_with_gradients_the_state_is_the_same():
    strain, constants = torch.full((1, 4), 0.8, dtype=torch.float64), Decay(SPEEDS)
    with torch.no_grad():
        plain = substepped(Relaxation().advance, strain, start(4), constants, Substepping())
    wanted = strain.clone().requires_grad_()
    again = substepped(Relaxation().advance, wanted, start(4), constants, Substepping())
    assert torch.equal(again.detach(), plain)
