"""Papers on iterative learning control, run through ilc-rt: one package per paper."""
