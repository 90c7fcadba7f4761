"""The command line, `palpate --help`: check, detect, simulate, bench and more."""

from palpate.cli.app import app, main

__all__ = ["app", "main"]
