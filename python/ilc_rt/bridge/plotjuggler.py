"""PlotJuggler: one JSON object per servo cycle, as its UDP server reads it without a plug-in.

A datagram is ``{"timestamp": 1764369000.002, "gantry": {"x": {"encoder_error_m": 2e-5, …}}}``;
PlotJuggler makes a series of each number, named by its path, ``gantry/x/encoder_error_m``. Choose
the protocol `json` there, and `timestamp` as the field of the time.
"""

from __future__ import annotations

import json
import socket
import time
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from ilc_rt.bridge.signals import Cells
from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError
from ilc_rt.events import IterationEvent
from ilc_rt.misfit import is_number

if TYPE_CHECKING:
    from ilc_rt import Cell
    from ilc_rt.bridge.signals import Recall
    from ilc_rt.monitor import Message

PORT = 9870
"""Port that PlotJuggler's UDP server proposes."""
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


class PlotJuggler(Closing):
    """Sender of a cell's signals to a PlotJuggler.

    Parameters
    ----------
    host, port : str, int
        Address of the computer that runs PlotJuggler, and the port of its UDP server.
    described : Cell, optional
        Description of the cell, for the names of its axes before it starts.
    recall : callable, optional
        Returns the stored runs of a cell, which name its axes after its start.

    Raises
    ------
    BadInputError
        If the host is unknown.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        described: Cell | None = None,
        recall: Recall | None = None,
    ) -> None:
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        except OSError as error:
            message = f"host = {host}: {error.strerror}"
            raise BadInputError(message) from error
        family, kind, protocol, _, address = found[0]
        self._address: tuple[object, ...] = address
        self._socket = socket.socket(family, kind, protocol)
        self._cells = Cells(described, recall)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def show(self, message: Message) -> int:
        """Send on what a message has, and return the number of datagrams."""
        n_sent = 0
        for row in self._cells.rows(message):
            run = {} if row.iteration is None else {"run": row.iteration}
            self._send(row.time_s, {message.cell: {**run, **row.axes}})
            n_sent += 1
        if isinstance(message.event, IterationEvent):
            figures = {key: value for key, value in message.payload.items() if is_number(value)}
            self._send(time.time(), {message.cell: {"iteration": figures}})
            n_sent += 1
        return n_sent

    def _send(self, time_s: float, content: dict[str, object]) -> None:
        datagram = json.dumps({"timestamp": time_s, **content}).encode()
        try:
            self._socket.sendto(datagram, self._address)
        except ConnectionRefusedError:
            # An earlier datagram found no PlotJuggler yet: it may still be started.
            return


def layout(cell: Cell) -> str:
    """Return a PlotJuggler layout for a cell: tracking errors, learned inputs, error by run."""
    root = ET.Element("root")
    tabs = ET.SubElement(root, "tabbed_widget", {"parent": "main_window", "name": "Main Window"})
    names, units = cell.axis_names, cell.axis_units
    axes = list(zip(names, units, strict=True))
    prefix = cell.name
    _tab(
        tabs,
        "cycles",
        {
            "error at the encoder": [f"{prefix}/{n}/encoder_error_{u}" for n, u in axes],
            "error at the tool": [f"{prefix}/{n}/tool_error_{u}" for n, u in axes],
            "learned input": [f"{prefix}/{n}/input" for n, _ in axes],
        },
    )
    _tab(tabs, "runs", {"RMS error": [f"{prefix}/iteration/tracking_rms_m"]})
    ET.SubElement(tabs, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.SubElement(root, "previouslyLoaded_Streamer", name="UDP Server")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode")


def _tab(parent: ET.Element, name: str, plots: dict[str, list[str]]) -> None:
    """Add a tab with plots below one another."""
    tab = ET.SubElement(parent, "Tab", tab_name=name, containers="1")
    container = ET.SubElement(tab, "Container")
    sizes = ";".join([f"{1 / len(plots):.6f}"] * len(plots))
    splitter = ET.SubElement(
        container, "DockSplitter", orientation="-", count=str(len(plots)), sizes=sizes
    )
    for title, curves in plots.items():
        area = ET.SubElement(splitter, "DockArea", name=title)
        plot = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines")
        for index, curve in enumerate(curves):
            ET.SubElement(plot, "curve", name=curve, color=COLORS[index % len(COLORS)])
