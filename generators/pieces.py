"""Finished results of a campaign as one small archive, to be continued on another machine.

``python -m granbench.generators.pieces unpack ARCHIVE CAMPAIGN`` brings them into a campaign's
folder, ``... pack CAMPAIGN ARCHIVE`` takes them out of one.

Only final results travel (those that no other job needs): the executor prepares a specimen
again when one of its tests is still missing, and spares it otherwise.
"""

import json
import shutil
import sys
import zipfile
from pathlib import Path

from granbench.errors import ConfigurationError
from granbench.generators.campaign_folder import RESULT_FILE
from granbench.whole_file import whole_file

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every member, so that equal results give an equal archive."""


def pack(campaign: Path, archive: Path) -> int:
    """Write the final results of a campaign into a zip archive; return how many there are.

    Parameters
    ----------
    campaign : its folder
    archive : written whole or not at all

    Raises
    ------
    ConfigurationError
        There is nothing to pack.
    """
    described = {
        path.parent: json.loads(path.read_text())
        for path in (campaign / "results").glob(f"*/{RESULT_FILE}")
    }
    needed = {need for job in described.values() for need in job["needs"]}
    folders = [folder for folder, job in described.items() if job["key"] not in needed]
    if not folders:
        raise ConfigurationError(f"{campaign} holds no finished result to pack; generate first")
    with (
        whole_file(archive, ConfigurationError) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as pieces,
    ):
        for folder in sorted(folders):
            for file in sorted(path for path in folder.rglob("*") if path.is_file()):
                name = file.relative_to(folder.parent).as_posix()
                member = zipfile.ZipInfo(name, EPOCH)
                pieces.writestr(member, file.read_bytes(), zipfile.ZIP_DEFLATED)
    return len(folders)


def unpack(archive: Path, campaign: Path) -> int:
    """Put the results of an archive into a campaign's folder; return how many were new.

    Raises
    ------
    ConfigurationError
        The archive is missing or damaged; nothing is written then.
    """
    try:
        with zipfile.ZipFile(archive) as pieces:
            if damaged := pieces.testzip():
                raise ConfigurationError(f"{archive}: {damaged} is damaged; fetch it again")
            results = campaign / "results"
            names = {Path(name).parts[0] for name in pieces.namelist()}
            new = {name for name in names if not (results / name).exists()}
            draft = campaign / "unpacking"
            shutil.rmtree(draft, ignore_errors=True)
            pieces.extractall(draft)
    except (OSError, zipfile.BadZipFile) as broken:
        raise ConfigurationError(f"{archive} is no archive of results: {broken}") from broken
    results.mkdir(parents=True, exist_ok=True)
    for name in sorted(new):
        (draft / name).replace(results / name)
    shutil.rmtree(draft)
    return len(new)


if __name__ == "__main__":
    action, source, target = sys.argv[1:]
    print({"pack": pack, "unpack": unpack}[action](Path(source), Path(target)), "results")
