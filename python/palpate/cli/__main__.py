"""`python -m palpate.cli`."""

from palpate.cli.app import main

main()
