"""`python -m cuspline`: the command line."""

from cuspline.app.entry import main

main()
