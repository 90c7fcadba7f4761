"""`python -m palpate`: the command line where its folder is not on the path."""

from palpate.cli import main

main()
