"""The summary of a dataset as tables and sentences for the terminal."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from rich.table import Table

from granbench.cli.printing import say, show

if TYPE_CHECKING:
    pass


def print_summary(summary: dict[str, Any]) -> None:
    """Print the summary of a dataset, see `granbench.data.summary`."""
    summary = _printable_values(summary)
    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_column()
    facts.add_column()
    for key in ("file", "licence", "thesis_section", "generator", "engine", "content_sha256"):
        facts.add_row(key.replace("_", " "), str(summary[key]))
    facts.add_row("size", f"{summary['bytes'] / 1e6:.2f} MB")
    facts.add_row(
        "records",
        f"{summary['paths']} paths of {summary['steps']} steps on {summary['specimens']} "
        f"specimens, {summary['component_order']} components",
    )
    facts.add_row("variables", ", ".join(summary["variables"]))
    for key in ("families", "gradings"):
        if key in summary:
            counts = summary[key].items()
            facts.add_row(key, ", ".join(f"{label} ({count})" for label, count in counts))
    if "pressures" in summary:
        pressures = (f"{pressure / 1e6:g}" for pressure in summary["pressures"])
        facts.add_row("p0", f"{', '.join(pressures)} MPa")
    if "preparation_frictions" in summary:
        facts.add_row("mu0", ", ".join(f"{mu:g}" for mu in summary["preparation_frictions"]))
    if "initial_void_ratio" in summary:
        low, high = summary["initial_void_ratio"]
        facts.add_row("e0", f"{low:.3f} to {high:.3f}")
    for key, value in summary["quality"].items():
        facts.add_row(key.replace("_", " "), f"{value:.3g}")
    show(f"{summary['dataset']} {summary['version']}", style="bold")
    show(facts)
    splits = Table("split", "paths", "specimens")
    for name, counts in summary["splits"].items():
        splits.add_row(name, str(counts["paths"]), str(counts["specimens"]))
    show(splits)
    if "strain_paths" in summary:
        show(_strain_path_table(summary["strain_paths"]))
    for sentence in (_leak_sentence(summary["leaks"]), *_scatter_sentences(summary)):
        say(sentence)


def _printable_values(value: Any) -> Any:
    """A copy with all text, including keys, made safe for a terminal."""
    from granbench.files.printable import printable

    if isinstance(value, dict):
        return {printable(key): _printable_values(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_printable_values(inner) for inner in value]
    return printable(value) if isinstance(value, str) else value


def _strain_path_table(by_split: dict[str, dict[str, Any]]) -> Table:
    table = Table("split", "median |Δε|", "std of strain", "max |ε|", "std of stress [kPa]")
    for name, found in by_split.items():
        table.add_row(
            name,
            f"{found['median_increment']:.2e}",
            ", ".join(f"{value:.3f}" for value in found["strain_std"].values()),
            f"{found['largest_strain']:.3f}",
            ", ".join(f"{1e-3 * value:.3g}" for value in found["stress_std"].values()),
        )
    return table


def _leak_sentence(leaks: dict[str, Any]) -> str:
    kinds = ("shared_specimens", "shared_preparations", "identical_paths")
    found = [f"{len(leaks[kind])} {kind.replace('_', ' ')}" for kind in kinds if leaks[kind]]
    if found:
        return f"The splits are not separate: {', '.join(found)}."
    nearest = leaks["nearest_path_distance"]
    if not nearest:
        return "There is only one split."
    pair = min(nearest, key=nearest.__getitem__)
    return (
        "No specimen, preparation or path is in two splits; the nearest paths of two splits "
        f"({pair}) are {nearest[pair]:.3g} standard deviations apart."
    )


def _scatter_sentences(summary: dict[str, Any]) -> Iterator[str]:
    if "replicate_scatter" not in summary:
        return
    scatter = summary["replicate_scatter"]
    if scatter is None:
        yield "No packing was prepared twice: the scatter between packings is unknown."
        return
    components = ", ".join(f"{rms:.3g}" for rms in scatter["stress_rms"])
    yield (
        f"Replicate scatter ({scatter['pairs']} pairs of paths, {scatter['specimens']} packings "
        f"prepared again): root-mean-square (RMS) difference of stress {components} training "
        "standard deviations by component; normalised mean squared error (MSE) "
        f"{scatter['stress_mse']:.3g}. A model that predicts the mean of packings prepared in the "
        f"same way would have half of it, {scatter['floor_mse']:.3g} (median pair "
        f"{scatter['floor_median']:.3g})."
    )
    if scatter["void_ratio_rms"] is not None:
        yield f"RMS difference of void ratio between packings: {scatter['void_ratio_rms']:.3g}."
