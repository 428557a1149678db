"""Errors of every path under one protocol, before anything is averaged over paths."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS, ProtocolSpec
from granbench.benchmark.comparison import (
    ERROR_POINT,
    predicted_steps,
    relative_error,
    squared_error,
)
from granbench.benchmark.metric import NotApplicable
from granbench.benchmark.scored_task import NO_GROUND_TRUTH, ScoredPredictions

READS_RECORDS = "the model reads its answers from the records, which have none for noised strain"
NO_VOID_RATIO = "the model does not predict the void ratio"


@dataclass(frozen=True)
class PathErrors:
    """Predicted against true stress of every path, from the first predicted step on.

    Parameters
    ----------
    protocol : how the predictions were made
    components : labels of the stress components
    predicted : (seed, path, step, component), Pa, compression positive; NaN after a breakdown
    true : (path, step, component), Pa
    stress_scale : (component,), training standard deviation, Pa
    void_ratio : (seed, path, step); None where the model does not predict it
    true_void_ratio : (path, step)
    void_ratio_scale : training standard deviation
    noised_truth : (seed, path, step, component), Pa, of the ground truth along the noised strain;
        None where the predictions hold none
    no_noised_truth : says why there is none, see the function of that name
    """

    protocol: ProtocolSpec
    components: Sequence[str]
    predicted: np.ndarray
    true: np.ndarray
    stress_scale: np.ndarray
    void_ratio: np.ndarray | None
    true_void_ratio: np.ndarray | None
    void_ratio_scale: np.ndarray | None
    noised_truth: np.ndarray | None
    no_noised_truth: Callable[[], str | None]

    @classmethod
    def of(cls, scored: ScoredPredictions, protocol: ProtocolSpec) -> "PathErrors":
        """The errors of predictions under one of their protocols.

        Parameters
        ----------
        scored : predictions that hold the protocol
        protocol : one of `PROTOCOLS`
        """
        predictions, records = scored.predictions, scored.records
        std = scored.normalisation.std
        chosen = predictions.sel(protocol=protocol.name)
        predicted = predicted_steps(chosen["stress"])
        void_ratio = true_void_ratio = None
        if "void_ratio" in predictions:
            void_ratio = predicted_steps(chosen["void_ratio"], ())
            true_void_ratio = predicted_steps(records["void_ratio"], ())
        noised_truth = None
        if protocol.noise and "noised_truth" in predictions:
            noised_truth = predicted_steps(predictions["noised_truth"].sel(noise=protocol.name))
        return cls(
            protocol=protocol,
            components=scored.task.components,
            predicted=predicted,
            true=predicted_steps(records["stress"]),
            stress_scale=std["stress"],
            void_ratio=void_ratio,
            true_void_ratio=true_void_ratio,
            void_ratio_scale=std.get("void_ratio"),
            noised_truth=noised_truth,
            no_noised_truth=lambda: no_noised_truth(scored),
        )

    @property
    def truths(self) -> list[np.ndarray]:
        """What predictions are compared with: the records, and the truth along noised strain."""
        return [self.true] if self.noised_truth is None else [self.true, self.noised_truth]

    @cached_property
    def broken(self) -> np.ndarray:
        """Where there is no finite stress, (seed, path, step)."""
        return np.logical_not(np.isfinite(self.predicted).all(axis=-1))

    @cached_property
    def component_error(self) -> np.ndarray:
        """Squared normalised stress error, (seed, path, step, component)."""
        broken = self.broken[..., None]
        return squared_error(self.predicted, self.true, self.stress_scale, broken)

    @property
    def step_error(self) -> np.ndarray:
        """Mean of `component_error` over the components, (seed, path, step)."""
        return self.component_error.mean(axis=-1)

    @cached_property
    def by_component(self) -> np.ndarray:
        """Mean of `component_error` over the steps, (seed, path, component)."""
        return self.component_error.mean(axis=-2)

    @cached_property
    def void_ratio_error(self) -> np.ndarray:
        """Squared normalised error of the void ratio, mean over the steps, (seed, path).

        Raises
        ------
        NotApplicable
            If the model does not predict it.
        """
        if self.void_ratio is None or self.true_void_ratio is None:
            raise NotApplicable(NO_VOID_RATIO)
        assert self.void_ratio_scale is not None  # the records have a void ratio
        broken = ~np.isfinite(self.void_ratio)
        return squared_error(
            self.void_ratio, self.true_void_ratio, self.void_ratio_scale, broken
        ).mean(axis=-1)

    @cached_property
    def relative(self) -> np.ndarray:
        """Norm of the stress error over that of the true stress, (seed, path, step)."""
        return relative_error(self.predicted, self.true, list(self.components), self.broken)

    @property
    def error_point(self) -> np.ndarray:
        """Whether a step is an error point, (seed, path, step)."""
        return self.relative > ERROR_POINT

    @cached_property
    def divergence_step(self) -> np.ndarray:
        """First step from which every later one is an error point, (seed, path); inf: none.

        Raises
        ------
        NotApplicable
            If the protocol gives the truth again before a run can diverge.
        """
        if self.protocol.restart is not None:
            raise NotApplicable("the true record is given again before a run can diverge")
        error_point = self.error_point
        steps = error_point.shape[-1]
        lost = np.cumprod(error_point[..., ::-1], axis=-1).sum(axis=-1)
        return np.where(lost > 0, steps - lost + 1.0, np.inf)

    @property
    def failed(self) -> np.ndarray:
        """Whether a run broke down at some predicted step, (seed, path)."""
        broken = self.broken
        if self.void_ratio is not None:
            broken = broken | ~np.isfinite(self.void_ratio)
        return np.asarray(broken.any(axis=-1))

    @cached_property
    def against_noised_truth(self) -> "ErrorsAgainstNoisedTruth":
        """Errors against the ground truth along the noised strain.

        Raises
        ------
        NotApplicable
            If there is no such truth.
        """
        if reason := self.no_noised_truth():
            raise NotApplicable(reason)
        if self.noised_truth is None:
            raise NotApplicable("the strain of this protocol has no noise")
        return ErrorsAgainstNoisedTruth.of(
            self.predicted, self.noised_truth, self.stress_scale, list(self.components)
        )


@dataclass(frozen=True)
class ErrorsAgainstNoisedTruth:
    """Errors over the steps that the ground truth itself can follow, each (seed, path).

    Parameters
    ----------
    squared : squared normalised stress error, mean over components and steps
    relative : norm of the stress error over that of the true stress, mean over steps
    error_point_share : share of steps that are error points
    """

    squared: np.ndarray
    relative: np.ndarray
    error_point_share: np.ndarray

    @classmethod
    def of(
        cls, predicted: np.ndarray, true: np.ndarray, scale: np.ndarray, labels: list[str]
    ) -> "ErrorsAgainstNoisedTruth":
        """Compare predicted with true stress, each (seed, path, step, component), Pa."""
        # Where the ground truth itself breaks down there is nothing to compare with.
        known = np.isfinite(true).all(axis=-1)
        weight = known / np.maximum(known.sum(axis=-1, keepdims=True), 1)
        true = np.where(known[..., None], true, 0.0)
        broken = np.logical_not(np.isfinite(predicted).all(axis=-1, keepdims=True))
        error = squared_error(predicted, true, scale, broken).mean(axis=-1)
        relative = relative_error(predicted, true, labels, broken[..., 0])
        return cls(
            squared=(weight * error).sum(axis=-1),
            relative=(weight * relative).sum(axis=-1),
            error_point_share=(weight * (relative > ERROR_POINT)).sum(axis=-1),
        )


def no_noised_truth(scored: ScoredPredictions) -> str | None:
    """Why there is no truth along noised strain, or None."""
    if not scored.task.has_ground_truth:
        return NO_GROUND_TRUTH
    return READS_RECORDS if scored.reads_records else None


def horizon_means(step_error: np.ndarray, protocol: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors averaged over the steps that lie equally far from given truth.

    Parameters
    ----------
    step_error : (..., step) from the first predicted step on
    protocol : label of the protocol

    Returns
    -------
    (horizon (k,), means (..., k))
    """
    horizon = PROTOCOLS[protocol].horizon(step_error.shape[-1] + 1)[1:]
    present = np.unique(horizon)
    means = [step_error[..., horizon == value].mean(axis=-1) for value in present]
    return present, np.stack(means, axis=-1)
