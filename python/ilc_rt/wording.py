"""Words for states and events, the same in every view of a campaign.

Imported by the views in the terminal, the monitor and the bridges.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt.text import printable

if TYPE_CHECKING:
    from ilc_rt.events import DriftEvent, StartEvent

WORDS = {
    "bringing_up": "bringing the drives up",
    "homing": "homing",
    "enabling": "switching the drives on",
    "returning": "returning to the start",
    "settling": "settling at the start",
    "waiting": "waiting for its start",
    "running": "running",
    "paused": "held on the path",
    "stopping": "stopping the axes",
    "stopped": "at rest",
}
"""States of a cell."""


def state_words(state: str) -> str:
    """Return the words for a state; of one that is not known, its name.

    Examples
    --------
    >>> state_words("returning"), state_words("warming_up")
    ('returning to the start', 'warming up')
    """
    return WORDS.get(state, printable(state.replace("_", " ")))


def describe(start: StartEvent) -> str:
    """Return one line on the coming campaign and its bus."""
    clock = "real time" if start.mode == "realtime" else "lock-step"
    seconds = start.n_samples * start.cycle_s
    axes = f"{start.n_axes} {'axis' if start.n_axes == 1 else 'axes'}"
    learns = {
        "none": "nothing is learned",
        "frozen": f"frozen input, watched at the {start.measure}",
    }.get(start.law, f"{start.law} learns from {start.measure}")
    return printable(
        f"{start.cell}: {axes}, {seconds:.2f} s a run at {start.cycle_s * 1e3:g} ms, "
        f"{learns}, {start.bus}, {clock}"
    )


def drift(event: DriftEvent) -> str:
    """Return one line on a frozen input that does not fit any more.

    Examples
    --------
    >>> from ilc_rt.events import DriftEvent
    >>> drift(DriftEvent(7, 1.5, "run 3 of campaign c", 2.0))
    'drift: the error of run 7 is 2.00 times that of run 3 of campaign c, 1.5 is allowed'
    """
    times = "beyond" if event.ratio is None else f"{event.ratio:.2f} times"
    line = f"drift: the error of run {event.index} is {times} that of {event.origin}"
    again = (
        f"; learning starts again from its input, in campaign {event.relearned_in}"
        if event.relearned_in
        else ""
    )
    return f"{line}, {event.allowed:g} is allowed{again}"
