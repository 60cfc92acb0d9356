"""What a person reads: report, setup sheet, plots, pictures."""
