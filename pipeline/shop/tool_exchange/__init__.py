"""Tool libraries of other programs: read in with a list of everything dropped or assumed, never guessed."""
