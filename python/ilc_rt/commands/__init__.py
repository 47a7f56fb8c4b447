"""The verbs of `ilc`, one per file; imported by the command line only."""
