"""`granbench data`: list, info, fetch, verify and plot datasets."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from granbench.cli.data_tables import print_summary
from granbench.cli.options import refuse_overwriting, require_writable
from granbench.cli.pictures import drawing_errors
from granbench.cli.printing import print_json, say, show
from granbench.cli.progress import progress_bar
from granbench.cli.shared_options import Json, Quiet
from granbench.cli.termination import stopped_by_sigterm

if TYPE_CHECKING:
    from granbench.data.registry import RegistryEntry

app = typer.Typer(
    help="Datasets: list, describe, fetch, verify and plot them.", no_args_is_help=True
)

Source = Annotated[str, typer.Argument(metavar="NAME|FILE", help="Dataset name or netCDF file.")]


@app.command("list")
def list_datasets(as_json: Json = False) -> None:
    """List the registered datasets."""
    from granbench.data.making import is_made_at_once, is_made_on_request
    from granbench.data.registry import entries
    from granbench.data.store import present_file

    def place(entry: "RegistryEntry", file: Path | None) -> str:
        if file:
            return "yes"
        if is_made_at_once(entry):
            return "made in seconds"
        return "made by `fetch --make`" if is_made_on_request(entry) else "no"

    rows = [(entry, present_file(entry)) for entry in entries()]
    if as_json:
        print_json(
            [
                entry.model_dump(mode="json") | {"local_file": str(file) if file else None}
                for entry, file in rows
            ]
        )
        return
    table = Table("dataset", "version", "tier", "size", "on this machine", "content")
    for entry, file in rows:
        size = f"{entry.bytes / 1e6:.1f} MB"
        table.add_row(entry.id, entry.version, entry.tier, size, place(entry, file), entry.title)
    show(table)


@app.command()
def info(
    source: Source,
    as_json: Json = False,
    paths: Annotated[bool, typer.Option("--paths", help="List all paths instead.")] = False,
) -> None:
    """Describe a dataset: splits, loading, quality, and the scatter between packings."""
    from granbench.data.store import file_of
    from granbench.data.summary import listed_paths, summarise_file
    from granbench.data.verification import read_as_trusted

    with progress_bar("fetching", shown="bytes") as bar:
        file = file_of(source, bar.move)
    if paths:
        rows = read_as_trusted(file, listed_paths)
        if as_json:
            print_json(rows)
        else:
            say("\n".join("  ".join(row.values()) for row in rows))
        return
    summary = read_as_trusted(file, summarise_file)
    summary |= {"file": str(file), "bytes": file.stat().st_size}
    if as_json:
        print_json(summary)
    else:
        print_summary(summary)


@app.command()
def fetch(
    name: Annotated[str, typer.Argument(help="Dataset name; NAME@VERSION for an older version.")],
    dest: Annotated[
        Path | None, typer.Option("--dest", help="Folder for the file.", file_okay=True)
    ] = None,
    make: Annotated[
        bool,
        typer.Option("--make", help="Make the dataset on this machine even if that takes minutes."),
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fetch a dataset from the nearest mirror and check it against the registry.

    If no mirror provides it, the dataset is made on this machine, provided that this takes only
    seconds; with --make, it may take minutes.
    """
    from granbench.data.store import bring, dataset_file

    with stopped_by_sigterm(), progress_bar("fetching", shown="bytes", hidden=quiet) as bar:
        if dest:
            file = bring(name, dest, bar.move, minutes=make)
        else:
            file = dataset_file(name, bar.move, minutes=make)
    if as_json:
        print_json({"name": name, "file": str(file)})
    elif not quiet:
        say(file)


@app.command()
def verify(source: Source, as_json: Json = False, quiet: Quiet = False) -> None:
    """Recompute the content hashes of a dataset, and name any variable that differs."""
    from granbench.data.store import file_of
    from granbench.data.verification import verify_file

    with progress_bar("fetching", shown="bytes", hidden=quiet) as bar:
        file = file_of(source, bar.move)
    entry = verify_file(file)
    if as_json:
        registered = f"{entry.id}@{entry.version}" if entry else None
        print_json({"file": str(file), "verified": True, "registered": registered})
    elif not quiet:
        known = (
            f"is {entry.id} {entry.version} of the registry, and so are its attributes"
            if entry
            else "is not registered, so its ground truth, its licence and its other attributes, "
            "except its configuration, cannot be verified"
        )
        say(f"{file}: every variable agrees with its hash; the dataset {known}")


@app.command()
def plot(
    source: Source,
    out: Annotated[
        Path | None, typer.Option("--out", help="PNG, PDF or SVG file to write.")
    ] = None,
    path: Annotated[
        list[str] | None,
        typer.Option("--path", help="Name of a path to draw, from `granbench data info --paths`."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Draw stress ratio and void ratio against axial strain, or strain paths and stresses."""
    from granbench.data.store import file_of
    from granbench.data.summary import draw_file
    from granbench.data.verification import read_as_trusted
    from granbench.plotting.style import figure_format

    if out is not None:  # before anything is fetched
        figure_format(out)
        require_writable("--out", out)
        refuse_overwriting(out, "NAME|FILE", Path(source))
    with progress_bar("fetching", shown="bytes", hidden=quiet) as bar:
        file = file_of(source, bar.move)
    picture = out or Path(f"{file.stem}.png")
    with drawing_errors(picture):
        read_as_trusted(file, draw_file, picture, path or None)
    if not quiet:
        say(picture)


@app.command(hidden=True)
def register(
    file: Annotated[Path, typer.Argument(help="Sealed netCDF file.")],
    identifier: Annotated[str, typer.Option("--id", help="Name in the registry.")],
    title: Annotated[str, typer.Option(help="One line for listings.")],
    command: Annotated[str, typer.Option(help="The command that made it.")],
    seconds: Annotated[
        float | None, typer.Option(help="Duration of the command, if anyone can run it.")
    ] = None,
    tier: Annotated[str, typer.Option(help="mini, core or paper.")] = "core",
    mirror: Annotated[list[str] | None, typer.Option(help="Folder or address.")] = None,
    replace: Annotated[bool, typer.Option(help="Before publication only.")] = False,
) -> None:
    """For maintainers: verify a file and write its registry entry."""
    from granbench.data.publish import register as write_entry

    entry = write_entry(
        file,
        identifier=identifier,
        title=title,
        command=command,
        seconds=seconds,
        tier=tier,
        mirrors=mirror or (),
        replace=replace,
    )
    say(f"registered {entry.id} {entry.version}: {entry.bytes} bytes, {entry.sha256}")


@app.command(hidden=True)
def mini(
    file: Annotated[Path, typer.Argument(help="The core dataset.")],
    replace: Annotated[bool, typer.Option(help="Before publication only.")] = False,
) -> None:
    """For maintainers: write the mini tier of a dataset into the package and register it."""
    from granbench.data.publish import publish_mini

    entry = publish_mini(file, replace=replace)
    say(f"registered {entry.id} {entry.version}: {entry.bytes} bytes, {entry.sha256}")
