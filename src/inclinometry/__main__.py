"""python -m inclinometry: the same as the command."""

from inclinometry.cli import main

main()
