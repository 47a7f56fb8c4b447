"""Printed figures of appendix I, tables I.1 to I.3, for comparison alone.

Section `appendix_i` imports it.
"""

from __future__ import annotations

#: Tables I.1 and I.2 at times 0 to 4: converged inputs and errors, in the order of the figures.
INPUT = {
    "x1": [1.7259, -2.3916, 4.1612, -4.1571, 0.0],
    "y1": [1.6569, -3.9662, 6.3751, -8.1458, 0.0],
    "x2": [0.9292, -0.9841, 2.0876, -1.5258, 0.0],
    "y2": [0.9966, -2.0448, 3.2467, -3.8187, 0.0],
    "x3": [1.2269, -1.1179, 2.3918, -1.5970, 0.0],
    "y3": [1.1957, -2.2825, 3.4305, -3.9004, 0.0],
}
ERROR = {
    "x1": [0.0, 0.0106, -0.0087, 0.0050, -0.0015],
    "y1": [0.0, 0.0173, -0.0148, 0.0090, -0.0028],
    "x2": [0.0, 0.0020, -0.0016, 0.0010, -0.0003],
    "y2": [0.0, 0.0039, -0.0035, 0.0022, -0.0008],
    "x3": [0.0, 0.0025, -0.0021, 0.0013, -0.0004],
    "y3": [0.0, 0.0042, -0.0039, 0.0026, -0.0009],
}
#: Decimals of tables I.1 and I.2.
DECIMALS = 4
#: Table I.3 with its decimals. E_h2 is read in thousandths: its power of ten is missing in print;
#: the last row, printed as E_y3, is E_h3.
FORMATION = {
    "d1": (4, [0.0, -0.0086, 0.0071, -0.0040, 0.0012]),
    "d2": (5, [0.0, 0.00049, -0.00050, 0.00037, -0.00011]),
    "d3": (4, [0.0, -0.0082, 0.0065, -0.0037, 0.0011]),
    "h1": (4, [0.0, -0.0134, 0.0113, -0.0067, 0.0020]),
    "h2": (7, [0.0, 0.0002810, -0.0004113, 0.0003987, -0.0001735]),
    "h3": (4, [0.0, -0.0132, 0.0109, -0.0063, 0.0019]),
}
#: Entry of table I.3 whose last digit is off by one, as its own rows of table I.2 show.
MISPRINT = ("d1", 2)
