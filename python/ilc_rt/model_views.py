"""Views of models: text, page, natural frequencies, objects of other libraries.

The compiled `StateSpace` calls them.
"""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt._native import StateSpace

    Array = NDArray[np.float64]

# Matrices beyond this size are shown by their shape.
SHOWN_MAX = 12


def natural_frequencies(model: StateSpace) -> tuple[Array, Array]:
    """Return natural frequencies in Hz and dampings of the poles, in the order of frequency.

    ``s = log(z) / dt`` for a discrete-time model; a pole at zero is a delay, of infinite frequency
    in theory, and left out.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import second_order
    >>> frequency_hz, damping = natural_frequencies(second_order(2 * np.pi * 15.0, 0.6))
    >>> frequency_hz.round(6).tolist(), damping.round(6).tolist()
    ([15.0, 15.0], [0.6, 0.6])
    """
    # LAPACK isolates the poles of a chain of delays, so that they are exactly zero.
    poles = np.linalg.eigvals(model.a).astype(np.complex128)
    if model.dt_s is not None:
        poles = np.log(poles[np.abs(poles) > 1e-12]).astype(np.complex128) / model.dt_s
    size = np.abs(poles).astype(np.float64)
    damping = np.where(size > 0.0, -poles.real / np.where(size > 0.0, size, 1.0), 1.0)
    order = np.argsort(size, kind="stable")
    return size[order] / (2.0 * np.pi), damping[order]


def text(model: StateSpace) -> str:
    """Return the model as lines: matrices, poles, delay.

    Examples
    --------
    >>> from ilc_rt import StateSpace
    >>> print(text(StateSpace([[0.5]], [[1.0]], [[2.0]], [[0.0]], 0.001)))
    StateSpace(n_states=1, n_inputs=1, n_outputs=1, dt_s=0.001)
    A = [[0.5]]
    B = [[1]]
    C = [[2]]
    D = [[0]]
    poles: 110.3 Hz (damping 1)
    delay: 1 sample
    """
    lines = [repr(model)]
    for name, matrix in _matrices(model):
        lines.append(f"{name} = {_matrix(matrix)}")
    lines += [f"{name}: {said}" for name, said in _facts(model)]
    return "\n".join(lines)


def page(model: StateSpace) -> str:
    """Return the model as a table, for a notebook.

    Examples
    --------
    >>> from ilc_rt import second_order
    >>> "poles" in page(second_order(94.0, 0.7))
    True
    """
    rows = [
        (name, f"<pre>{html.escape(_matrix(matrix))}</pre>") for name, matrix in _matrices(model)
    ]
    rows += [(name, html.escape(said)) for name, said in _facts(model)]
    body = "".join(f"<tr><th>{name}</th><td>{said}</td></tr>" for name, said in rows)
    return f"<table><caption>{html.escape(repr(model))}</caption><tbody>{body}</tbody></table>"


def _matrices(model: StateSpace) -> list[tuple[str, Array]]:
    return [("A", model.a), ("B", model.b), ("C", model.c), ("D", model.d)]


def _matrix(matrix: Array) -> str:
    if max(matrix.shape, default=0) > SHOWN_MAX:
        return f"{matrix.shape[0]} by {matrix.shape[1]}"
    rows = ["[" + ", ".join(f"{value:.6g}" for value in row) + "]" for row in matrix]
    return "[" + (",\n     ".join(rows) or "") + "]"


def _facts(model: StateSpace) -> list[tuple[str, str]]:
    facts = []
    try:
        pairs = zip(*natural_frequencies(model), strict=True)
        known = dict.fromkeys(f"{hz:.4g} Hz (damping {damping:.3g})" for hz, damping in pairs)
        if known:
            more = ["…"] if len(known) > SHOWN_MAX else []
            facts.append(("poles", ", ".join([*list(known)[:SHOWN_MAX], *more])))
        if model.dt_s is not None:
            delays = {delay for row in model.delays() for delay in row if delay is not None}
            if delays:
                low, high = min(delays), max(delays)
                range_of = f"{low}" if low == high else f"{low} to {high}"
                facts.append(("delay", f"{range_of} sample{'' if low == high == 1 else 's'}"))
    except ModelError:
        # Of a model whose poles cannot be computed the matrices are shown.
        pass
    return facts


def to_scipy(model: StateSpace) -> object:
    """Return the model as an object of scipy.signal, discrete-time if it is."""
    from scipy.signal import StateSpace as OfScipy

    time = {} if model.dt_s is None else {"dt": model.dt_s}
    return OfScipy(model.a, model.b, model.c, model.d, **time)


def to_control(model: StateSpace) -> object:
    """Return the model as an object of python-control, discrete-time if it is."""
    from control import StateSpace as OfControl

    return OfControl(model.a, model.b, model.c, model.d, model.dt_s or 0.0)
