"""Papers on iterative learning control, run through ilc-rt: one package a paper."""
