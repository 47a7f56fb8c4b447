"""Comparisons on the page of the libraries that overtake each other."""

import asyncio
import contextlib
import threading
from types import SimpleNamespace

import pytest


def test_a_comparison_that_was_overtaken_is_not_drawn(monkeypatch):
    pytest.importorskip("nicegui", reason="nicegui is not installed")
    from ilc_rt.dashboard import library_page

    begun, goes_on, drawn = threading.Event(), threading.Event(), []

    run = SimpleNamespace(row={"axis_names": ["x"]})

    class Archive:
        def why_not(self, key):
            return None

        def aligned(self, keys, axis):
            if len(keys) == 1:
                begun.set()
                assert goes_on.wait(30.0)
            return [run for _ in keys]

    class Axes(contextlib.nullcontext):
        def clear(self):
            pass

    monkeypatch.setattr(library_page, "say", lambda *_: None)
    monkeypatch.setattr(library_page, "text", lambda *_: None)
    monkeypatch.setattr(library_page, "tag", lambda *_, **__: contextlib.nullcontext())
    monkeypatch.setattr(library_page.charts, "compared", lambda runs, *_: len(runs))
    monkeypatch.setattr(library_page, "draw", lambda _client, _name, count: drawn.append(count))
    view = object.__new__(library_page.LibraryView)
    view._archive, view._axes, view._client, view._which = Archive(), Axes(), None, None
    view._axis, view._chosen, view._n_comparisons = 0, {(0, 1): None}, 0

    async def choose_two():
        slow = asyncio.create_task(view._compare())
        await asyncio.to_thread(begun.wait, 30.0)
        view._chosen[(0, 2)] = None
        await view._compare()
        goes_on.set()
        await slow

    asyncio.run(choose_two())
    assert drawn == [2, 2, 2]
