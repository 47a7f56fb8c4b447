"""Operators of models: products, sums, powers and channels.

The compiled `StateSpace` calls them for its operators.
"""

from __future__ import annotations

from numbers import Number

import numpy as np

from ilc_rt._native import StateSpace

_Key = int | slice | list[int]

POWER_MAX = 16


def _is_array(operand: object) -> bool:
    return isinstance(operand, list) or (
        # A model of python-control has an `__array__` too.
        hasattr(operand, "__array__") and not hasattr(operand, "A")
    )


def _factor(model: StateSpace, operand: object, n_signals: int) -> StateSpace:
    """Return the second model of a product; a matrix is a gain."""
    if not _is_array(operand):
        return StateSpace._of(operand)
    gain = model._gain(operand)
    if n_signals not in {gain.n_outputs, gain.n_inputs}:
        message = (
            f"gain has shape ({gain.n_outputs}, {gain.n_inputs}); "
            f"{n_signals} rows or columns is needed"
        )
        raise ValueError(message)
    return gain


def _addend(model: StateSpace, operand: object) -> StateSpace:
    """Return the second model of a sum; a number is that gain from every input to every output."""
    if isinstance(operand, Number):
        shape = (model.n_outputs, model.n_inputs)
        return model._gain(np.full(shape, operand))
    return model._gain(operand) if _is_array(operand) else StateSpace._of(operand)


def product(model: StateSpace, first: object) -> StateSpace:
    """Return ``model * first``: `first` acts before the model."""
    if isinstance(first, Number):
        return model._scaled(first)
    return _factor(model, first, model.n_inputs).series(model)


def product_after(model: StateSpace, last: object) -> StateSpace:
    """Return ``last * model``: `last` acts after the model."""
    if isinstance(last, Number):
        return model._scaled(last)
    return model.series(_factor(model, last, model.n_outputs))


def quotient(model: StateSpace, divisor: object) -> StateSpace:
    """Return the model over a number."""
    if not isinstance(divisor, (int, float)):
        message = f"divisor = {divisor!r}; a number is needed"
        raise TypeError(message)
    return model._scaled(1.0 / divisor)


def sum_of(model: StateSpace, other: object) -> StateSpace:
    """Return the sum of the outputs of two models with the same input."""
    return model._sum(_addend(model, other))


def difference(model: StateSpace, other: object) -> StateSpace:
    """Return ``model - other``."""
    return model._sum(-_addend(model, other))


def difference_from(model: StateSpace, other: object) -> StateSpace:
    """Return ``other - model``."""
    return _addend(model, other)._sum(-model)


def power(model: StateSpace, exponent: object) -> StateSpace:
    """Return the model in series with itself; of the inverse for a negative exponent."""
    if not isinstance(exponent, int) or exponent == 0 or abs(exponent) > POWER_MAX:
        message = f"exponent = {exponent!r}: allowed -{POWER_MAX} to {POWER_MAX}, without 0"
        raise ValueError(message)
    base = model._inverse() if exponent < 0 else model
    result = base
    for _ in range(abs(exponent) - 1):
        result = result.series(base)
    return result


def channels(model: StateSpace, key: tuple[_Key, _Key]) -> StateSpace:
    """Return ``model[outputs, inputs]``: indices, slices or lists of indices."""
    outputs, inputs = key
    return model._select(
        _chosen("output", outputs, model.n_outputs), _chosen("input", inputs, model.n_inputs)
    )


def _chosen(name: str, key: _Key, count: int) -> list[int]:
    """Return the indices that a key selects; negative ones count from the end."""
    numbers = range(count)
    if isinstance(key, slice):
        return list(numbers[key])
    chosen = key if isinstance(key, list) else [key]
    try:
        return [numbers[index] for index in chosen]
    except (IndexError, TypeError) as error:
        message = f"{name} = {key}: there are {count}, numbered from 0"
        raise IndexError(message) from error
