"""Barton 2010: coordinated iterative learning control."""
