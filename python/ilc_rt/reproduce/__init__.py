"""Papers on iterative learning control, run through the product: one package a paper."""
