"""The verbs of `ilc`, one a file; imported by the command line only."""
