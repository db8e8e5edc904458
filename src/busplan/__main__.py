"""`python -m busplan`."""

from busplan.cli import main

main()
