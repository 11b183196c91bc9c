"""The command line: argument parsing, progress, exit codes; one file a command."""

from peakflight.cli.main import main

__all__ = ["main"]
