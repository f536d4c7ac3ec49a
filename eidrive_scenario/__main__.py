"""`python -m eidrive_scenario` is `eidrive`."""

from eidrive_scenario.cli import main

main()
