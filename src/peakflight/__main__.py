"""`python -m peakflight`: the command line."""

from peakflight.cli import main

main()
