"""Write the statistics and the figure of docs/random_paths.md.

Run ``python docs/random_paths_page.py`` from the root of the checkout; `make docs` does this. The
paths are those of the preset `core` of the `gp-*` datasets with the default seed, before they are
rounded to the strain grid.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from page_parts import table, with_parts, write_picture

from granbench.generators.classical.admissible import EXPLANATION, admissible_factors
from granbench.generators.classical.design import (
    CONFINEMENT,
    CORE,
    OUT_OF_DISTRIBUTION,
    THESIS_PATHS,
    split_seed,
)
from granbench.models import find_model
from granbench.plotting.random_paths import random_path_figure
from granbench.tensors import COMPONENT_ORDERS, frobenius_norm

PAGE = Path(__file__).parent / "random_paths.md"
PICTURE = Path(__file__).parent / "random_paths.png"
SEED = 0
"""Default seed of `granbench generate`."""

SHOWN = ("train/0000", "train/0001", "train/0002", "ood-rougher/0000", "ood-cyclic/0000")
SCALED_PATHS = 200
"""Number of training paths for the statistics of the volumetric factors."""

PRESSURE_DEPENDENT = {"gp-dp": "drucker-prager", "gp-csuh": "csuh"}


def drawn() -> xr.Dataset:
    """Training paths and paths out of distribution, laid out as in a dataset."""
    counts = {"train": CORE.train} | dict.fromkeys(OUT_OF_DISTRIBUTION, CORE.ood)
    families = {"train": THESIS_PATHS, **OUT_OF_DISTRIBUTION}
    strain = [
        family.draw(np.random.default_rng(split_seed(split, SEED)), counts[split], CORE.steps)
        for split, family in families.items()
    ]
    return xr.Dataset(
        {"strain": (("path", "step", "component"), np.concatenate([s.strain for s in strain]))},
        coords={
            "component": list(COMPONENT_ORDERS["plane"]),
            "split": ("path", np.repeat(list(counts), list(counts.values()))),
            "path_id": ("path", [f"{s}/{n:04d}" for s in counts for n in range(counts[s])]),
        },
    )


def families_part() -> str:
    """Table of the families and ranges that the splits are drawn from."""
    rows = []
    for split, family in {"train, validation, test": THESIS_PATHS, **OUT_OF_DISTRIBUTION}.items():
        ranges = family.model_dump().items()
        shown = ", ".join(f"`{field}` {low:g} … {high:g}" for field, (low, high) in ranges)
        rows.append((f"`{split}`", f"`{family.loading_family}`", shown))
    return table(("split", "family", "ranges"), rows)


def statistics_part(paths: xr.Dataset) -> str:
    """Table of median increments, standard deviations and the largest strain, by split."""
    splits = paths["split"].values.astype(str)
    rows = []
    for split in dict.fromkeys(splits.tolist()):
        strain = paths["strain"].values[splits == split]
        increments = np.diff(strain, axis=1)
        medians = (
            np.median(frobenius_norm(increments, "plane")),
            np.median(np.linalg.norm(increments, axis=-1)),
        )
        deviations = strain.std(axis=(0, 1))
        rows.append(
            (
                f"`{split}`",
                str(len(strain)),
                *(f"{1e3 * median:.3g}" for median in medians),
                *(f"{100.0 * deviation:.2f}" for deviation in deviations),
                f"{100.0 * np.abs(strain).max():.1f}",
            )
        )
    header = (
        "split", "paths", r"median $\lVert\Delta\varepsilon\rVert_F$ [10⁻³]",
        "the same with the shear counted once [10⁻³]",
        r"std. dev. $\varepsilon_{xx}$ [%]", r"$\varepsilon_{yy}$ [%]", r"$\varepsilon_{xy}$ [%]",
        r"largest $\lvert\varepsilon_{ij}\rvert$ [%]",
    )  # fmt: skip
    return table(header, rows)


def factors_part(paths: xr.Dataset) -> str:
    """Table of the volumetric factors of the first training paths, by dataset."""
    strain = paths["strain"].values[:SCALED_PATHS]
    rows = []
    for dataset, model in PRESSURE_DEPENDENT.items():
        factors = admissible_factors(find_model(model)(), strain, CONFINEMENT)
        low, middle, high = np.quantile(factors, [0.1, 0.5, 0.9])
        kept = 100.0 * np.mean(factors == 1.0)
        rows.append((f"`{dataset}`", f"{kept:.0f} %", f"{low:.2f}", f"{middle:.2f}", f"{high:.2f}"))
    header = ("dataset", "paths kept as drawn", "10 % quantile", "median", "90 %")
    return f"{EXPLANATION}\n\nOf the first {SCALED_PATHS} training paths:\n\n{table(header, rows)}"


def page(paths: xr.Dataset) -> str:
    """Text of the page."""
    parts = {
        "families": families_part(),
        "factors": factors_part(paths),
        "statistics": statistics_part(paths),
    }
    return with_parts(PAGE.read_text(encoding="utf-8"), parts)


if __name__ == "__main__":
    chosen = drawn()
    PAGE.write_text(page(chosen), encoding="utf-8")
    write_picture(random_path_figure(chosen, SHOWN), PICTURE)
