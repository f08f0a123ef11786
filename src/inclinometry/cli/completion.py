"""Completion of the shell."""

from __future__ import annotations


def install() -> None:
    """Let the shell complete commands, options and choices."""
    from inclinometry.cli import output
    from inclinometry.cli.app import app

    output.print_line(f"completion written to {app.install_completion()}; it is there in the next shell")
