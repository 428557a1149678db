"""Mixed control: a test as prescribed strains and held stresses at every step, for many points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from granbench.errors import ConfigurationError
from granbench.paths.programme import Floats, LoadingProgramme
from granbench.tensors import COMPONENT_ORDERS, PRINCIPAL_DIRECTIONS, normal_mask


@dataclass(frozen=True)
class MixedControl:
    """Prescribed strains and held stresses at every step of element tests, one test a point.

    The strain is ``driven + free @ x`` with unknown x, found such that ``held @ stress`` equals
    `targets`: a `LoadingProgramme` at given driving lengths, in any component order.

    Parameters
    ----------
    order : component order of strain and stress
    driven : (point, step, component), prescribed part of the cumulative strain; step 0 is the
        reference
    free : (point, component, control), strain directions that follow the stresses
    held : (point, control, component), stress combinations that are held
    targets : (point, step, control), their values, Pa; those of step 0 are never asked for
    """

    order: str
    driven: Floats
    free: Floats
    held: Floats
    targets: Floats

    @classmethod
    def of_strain(cls, order: str, strain: Floats) -> MixedControl:
        """Strain control along cumulative strain (point, step, component)."""
        points, steps, components = strain.shape
        return cls(
            order,
            np.asarray(strain, dtype=float),
            np.zeros((points, components, 0)),
            np.zeros((points, 0, components)),
            np.zeros((points, steps, 0)),
        )

    @classmethod
    def of_components(
        cls, order: str, held: Iterable[str], strain: Floats, stress: Floats
    ) -> MixedControl:
        """Control of one point by components: of each, its strain or its stress is prescribed.

        Parameters
        ----------
        order : component order
        held : labels of the components whose stress is prescribed
        strain, stress : (step, component), cumulative and Pa; entries of a component that the
            other one prescribes are not read
        """
        labels = COMPONENT_ORDERS[order]
        places = [labels.index(label) for label in held]
        unit = np.eye(len(labels))[places]
        driven = np.array(strain, dtype=float)
        driven[:, places] = 0.0
        targets = np.asarray(stress, dtype=float)[:, places]
        return cls(order, driven[None], unit.T[None], unit[None], targets[None])

    @classmethod
    def of_programme(
        cls, programme: LoadingProgramme, lengths: Sequence[float] | Floats, order: str
    ) -> MixedControl:
        """A loading programme as control of one point.

        Parameters
        ----------
        programme : what is prescribed
        lengths : (step,), driving lengths, the first zero; they may fall, and be negative, where
            the programme has a driving component
        order : component order, a key of `granbench.tensors.COMPONENT_ORDERS`

        Raises
        ------
        ConfigurationError
            If the lengths leave the programme, or the order lacks a component that it needs.
        """
        at = np.asarray(lengths, dtype=float)
        least = 0.0 if programme.driving_component is None else -programme.path_length
        if not ((at >= least) & (at <= programme.path_length)).all():
            raise ConfigurationError(
                f"the {programme.loading_family} programme goes from {least:g} to "
                f"{programme.path_length:g}, but its history from {at.min():g} to {at.max():g}; "
                "shorten the history or lengthen the programme"
            )
        driven = np.stack([programme.driven_strain(length) for length in at])
        free, held = programme.free_directions, programme.controlled_stresses
        place = _placing(programme.order, order)
        used = np.abs(driven).max(axis=0) + np.abs(free).sum(axis=1) + np.abs(held).sum(axis=0)
        if (lost := (used > 0.0) & ~place.any(axis=0)).any():
            label = COMPONENT_ORDERS[programme.order][int(np.argmax(lost))]
            raise ConfigurationError(
                f"the test needs the direction {label}, which {order} components "
                f"({', '.join(COMPONENT_ORDERS[order])}) do not have; use a model in other "
                "components, or another test"
            )
        targets = np.stack([programme.targets(length) for length in at])
        return cls(
            order,
            (driven @ place.T)[None],
            (place @ free)[None],
            (held @ place.T)[None],
            targets[None],
        )

    @classmethod
    def together(cls, controls: Sequence[MixedControl]) -> MixedControl:
        """Several tests as one batch; they hold equally many stresses over equally many steps.

        Raises
        ------
        ConfigurationError
            If they differ in component order, steps or number of held stresses.
        """
        kinds = {(c.order, c.driven.shape[1], c.held.shape[1]) for c in controls}
        if len(kinds) != 1:
            raise ConfigurationError(
                f"{len(controls)} tests differ in component order, steps or number of held "
                "stresses; run those that agree together"
            )
        parts = ("driven", "free", "held", "targets")
        joined = (np.concatenate([getattr(c, part) for c in controls]) for part in parts)
        return cls(controls[0].order, *joined)

    @property
    def steps(self) -> int:
        """Number of rows, the reference included."""
        return self.driven.shape[1]


def _placing(source: str, target: str) -> Floats:
    """Matrix (component of `target`, component of `source`) that moves components over."""
    names = PRINCIPAL_DIRECTIONS[target] if source == "principal" else {}
    return np.array(
        [
            [float(names.get(label, label) == own) for label in COMPONENT_ORDERS[source]]
            for own in COMPONENT_ORDERS[target]
        ]
    )


def isotropic_stress(pressure: float, order: str) -> Floats:
    """The stress p on every normal component and none on the others, (component,), Pa."""
    return pressure * np.array(normal_mask(order))
