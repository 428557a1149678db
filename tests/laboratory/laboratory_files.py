"""Small laboratory files in the formats that are read, made from known tests."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

KARLSRUHE_HEADER = (
    "eps1        epsv      eps3             epsq       Void ratio    q           p          "
    "eta = q/p  \r\n"
    "[%]         [%]       [%]              [%]        [%]           [kPa]       [kPa]      [-]\r\n"
    "\r\n"
)


def drained_curve(rows: int = 40, lateral: float = 100.0) -> dict[str, np.ndarray]:
    """A drained test as a laboratory has it: engineering strain in %, stress in kPa."""
    axial = np.linspace(0.0, 20.0, rows)
    volume = 0.5 * np.sin(axial / 3.0) - 0.3 * axial
    q = 1.4 * lateral * axial / (0.5 + axial)
    void_ratio = 0.8 - 1.8 * volume / 100.0
    return {"eps1": axial, "epsv": volume, "q": q, "p": lateral + q / 3.0, "e": void_ratio}


def write_csv(path: Path, headers: Sequence[str], columns: Sequence[np.ndarray]) -> Path:
    lines = [",".join(headers)]
    lines += [",".join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_karlsruhe(path: Path, curve: dict[str, np.ndarray]) -> Path:
    """A table like the files of the Karlsruhe sand: two header lines, tabs, Windows line ends."""
    radial = (curve["epsv"] - curve["eps1"]) / 2.0
    deviatoric = 2.0 / 3.0 * (curve["eps1"] - radial)
    ratio = curve["q"] / curve["p"]
    columns = (
        curve["eps1"], curve["epsv"], radial, deviatoric, curve["e"], curve["q"], curve["p"], ratio
    )  # fmt: skip
    rows = ["\t".join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_bytes((KARLSRUHE_HEADER + "\r\n".join(rows) + "\r\n").encode())
    return path


def write_protocol(path: Path, curve: dict[str, np.ndarray], *, sheet: str = "CID-REC-1") -> Path:
    """A SoilModels protocol with one drained test, as small as an .xlsx file can be."""
    lateral = curve["p"] - curve["q"] / 3.0
    headers = (
        "epax=dh/h0 [%]", "sigrad' [kPa]", "q [kPa]", "epv=dV/V0 [%] (dilatancy is negative)"
    )  # fmt: skip
    texts = ["initial void ratio (at the start of the shear)", *headers]
    rows = [_row(1, [("s", 0), ("n", curve["e"][0])]), _row(2, [("s", k) for k in range(1, 5)])]
    numbers = zip(curve["eps1"], lateral, curve["q"], curve["epsv"], strict=True)
    rows += [_row(n, [("n", value) for value in row]) for n, row in enumerate(numbers, start=3)]
    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "xl/workbook.xml",
            f'<workbook {main} xmlns:r="{office}"><sheets>'
            f'<sheet name="{sheet}" sheetId="1" r:id="rId1"/></sheets></workbook>',
        )
        archive.writestr(
            "xl/_rels/workbook.xml.rels",
            '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
            '<Relationship Id="rId1" Type="t" Target="worksheets/sheet1.xml"/></Relationships>',
        )
        items = "".join(f"<si><t>{escape(text)}</t></si>" for text in texts)
        archive.writestr("xl/sharedStrings.xml", f"<sst {main}>{items}</sst>")
        archive.writestr(
            "xl/worksheets/sheet1.xml",
            f"<worksheet {main}><sheetData>{''.join(rows)}</sheetData></worksheet>",
        )
    return path


def _row(number: int, cells: Sequence[tuple[str, float]]) -> str:
    inside = "".join(
        f'<c r="{"ABCD"[at]}{number}" t="{kind}"><v>{value!r}</v></c>'
        for at, (kind, value) in enumerate((k, float(v) if k == "n" else v) for k, v in cells)
    )
    return f'<row r="{number}">{inside}</row>'
