"""Entry point of `python -m eidrive_scenario`, equal to `eidrive`."""

from eidrive_scenario.cli import main

main()
