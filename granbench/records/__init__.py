"""Stress-strain records: their schema, its check, and their files."""

from granbench.records.check import validate_records
from granbench.records.files import (
    attributes_hash,
    content_hashes,
    dataset_hash,
    mark_as_checked,
    open_records,
    open_records_here,
    seal,
    verify,
    write_records,
)
from granbench.records.schema import (
    CONVENTIONS,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    VariableSpec,
    describe,
    path_blocks,
)

__all__ = [
    "CONVENTIONS",
    "REQUIRED_ATTRIBUTES",
    "SCHEMA",
    "VariableSpec",
    "attributes_hash",
    "content_hashes",
    "dataset_hash",
    "describe",
    "mark_as_checked",
    "open_records",
    "open_records_here",
    "path_blocks",
    "seal",
    "validate_records",
    "verify",
    "write_records",
]
