"""The command line: one application, one way to say what went wrong."""

from granbench.cli.application import app, main

__all__ = ["app", "main"]
