"""The web server of the dashboard: pages, files, hosts that are served."""

from __future__ import annotations

import contextlib
import signal
import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import nicegui
import uvicorn
from fastapi import FastAPI, Response
from fastapi.staticfiles import StaticFiles
from nicegui import ui
from starlette.middleware.trustedhost import TrustedHostMiddleware

from ilc_rt.addresses import is_local, unusable
from ilc_rt.dashboard.cell_page import build_cell
from ilc_rt.dashboard.library_page import build_library
from ilc_rt.dashboard.look import colours, text_of
from ilc_rt.dashboard.overview import build_overview
from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.fleet import Fleet

KINDS = {"dashboard.js": "text/javascript", "dashboard.css": "text/css"}
#: Seconds for which a browser that has lost its connection may come back to its page.
RECONNECT_S = 15.0


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Raises
    ------
    BadInputError
        If the address is not one of this computer, or is in use.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((host, port))
            # From now on a browser waits for the server instead of being refused.
            listener.listen(128)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        raise BadInputError(unusable(host, port, error.strerror or error)) from error
    return listener


def serve(
    fleet: Fleet, archive: Archive, listener: socket.socket, host: str, end_s: float | None = None
) -> None:
    """Serve the pages until interrupted, or for `end_s` seconds.

    Notes on runs can be written from this computer alone. A page of a stranger in the same browser
    reaches nothing here: other names of this host are refused.
    """
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    local = is_local(host)
    if local:
        names = ["127.0.0.1", "localhost", "[::1]", host]
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=names)
    _files(app)
    _pages(fleet, archive, with_notes=local)
    ui.run_with(
        app, title="ilc-rt", dark=None, tailwind=False, reconnect_timeout=RECONNECT_S,
        show_welcome_message=False,
    )  # fmt: skip
    server = _Server(
        uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1, ws="wsproto")
    )
    if end_s is not None:
        timer = threading.Timer(end_s, lambda: setattr(server, "should_exit", True))
        timer.daemon = True
        timer.start()
    server.run(sockets=[listener])
    if server.stopped_by == signal.SIGINT:
        raise KeyboardInterrupt
    if server.stopped_by is not None:
        raise SystemExit(128 + server.stopped_by)


class _Server(uvicorn.Server):
    """A server that ends at a signal and leaves the rest to its caller.

    That of uvicorn raises the signal again, which would end the process before it has left the
    network of the cells.
    """

    stopped_by: int | None = None

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Take signals while serving."""
        before = {n: signal.signal(n, self._stop) for n in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self.stopped_by = number
        self.handle_exit(number, frame)


def _files(app: FastAPI) -> None:
    charts = Path(nicegui.__file__).parent / "elements" / "echart" / "dist"
    app.mount("/echarts", StaticFiles(directory=charts))

    @app.get("/dashboard/colours.css")
    def _colours() -> Response:
        return Response(colours(), media_type="text/css")

    @app.get("/dashboard/{name}")
    def _file(name: str) -> Response:
        if name not in KINDS:
            return Response(status_code=404)
        return Response(text_of(name), media_type=KINDS[name])


def _pages(fleet: Fleet, archive: Archive, *, with_notes: bool) -> None:
    @ui.page("/")
    def _overview() -> None:
        build_overview(fleet)

    @ui.page("/cell/{name}")
    def _cell(name: str) -> None:
        build_cell(fleet, archive, name)

    @ui.page("/library")
    def _library() -> None:
        build_library(fleet, archive, with_notes=with_notes)
