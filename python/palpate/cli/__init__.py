"""The command line: `palpate check | tree | detect | simulate | convert | format`."""

from palpate.cli.app import app, main

__all__ = ["app", "main"]
