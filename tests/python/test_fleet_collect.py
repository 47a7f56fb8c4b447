"""Live collection: the events of a campaign on Zenoh, completed by a sync of its library."""

from __future__ import annotations

import json
import socket
import threading
from typing import TYPE_CHECKING, Any

import pytest
from ports_fixture import free_port
from postgres_fixture import server

from ilc_rt import BadInputError, Library
from ilc_rt.fleet import Collector, FleetLibrary, push
from ilc_rt.fleet.database import connect
from ilc_rt.monitor import Monitor

zenoh = pytest.importorskip("zenoh")

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with server() as running:
        yield running.database()


def events(library: str) -> list[tuple[str, dict[str, Any]]]:
    """Return topics and events of the campaign of a library, as the controller published them."""
    runs = Library(library).list()
    first = runs[0]
    same = ("cell", "campaign", "n_samples", "n_axes", "axis_names", "cycle_s", "measure", "law",
            "input_units")  # fmt: skip
    start = {key: first[key] for key in same} | {
        "event": "start", "first_index": 0, "iterations": 3, "bus": "loopback:", "mode": "lock-step"
    }  # fmt: skip
    ended = [("iteration", run | {"event": "iteration"}) for run in runs]
    judged = {"event": "judged", "id": 2, "index": 1, "rolled_back": True, "learning_off": False,
              "remark": "the error grew"}  # fmt: skip
    return [("state", start), *ended, ("iteration", judged)]


def test_figures_are_there_at_once_and_arrays_after_a_sync(
    address: str, finished: CampaignResult
) -> None:
    library = str(finished.library)
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    cell = zenoh.open(config)
    known = threading.Event()
    cell.declare_queryable("ilc/gantry/state", lambda query: (known.set(), query.drop()))
    token = cell.liveliness().declare_token("ilc/gantry/alive")
    try:
        with (
            Collector(address) as collector,
            Monitor("*", [endpoint], scouting=False) as monitor,
        ):
            messages = monitor.messages(60.0)
            # Who asks for the state has subscribed before.
            collector.take(next(messages))
            publish = threading.Thread(target=_publish, args=(cell, known, events(library)))
            publish.start()
            for message in messages:
                collector.take(message)
                if message.topic == "iteration" and message.payload["event"] == "judged":
                    break
            publish.join()
            assert (collector.stored, collector.unknown, collector.n_waiting) == (3, set(), 0)
    finally:
        token.undeclare()
        cell.close()

    own = Library(library).list()
    with FleetLibrary(address) as fleet:
        live = fleet.list("gantry")
        assert [run["digest"] for run in live] == [run["digest"] for run in own]
        assert [run["tracking_rms_m"] for run in live] == [run["tracking_rms_m"] for run in own]
        assert [run["rolled_back"] for run in live] == [False, True, False]
        assert not any(run["has_signals"] for run in live)
        with pytest.raises(BadInputError, match="known from its event alone"):
            fleet.load(live[0]["id"])
        assert push(library, address).stored == 3
        complete = fleet.list("gantry")
        assert [run["id"] for run in complete] == [run["id"] for run in live]
        for run, mine in zip(complete, own, strict=True):
            assert run == mine | {"id": run["id"], "has_signals": True}
        assert fleet.load(live[0]["id"])["error_m"].shape == (own[0]["n_samples"], 2)


def _publish(cell: Any, known: threading.Event, all_events: list[Any]) -> None:
    assert known.wait(60)
    for topic, event in all_events:
        cell.put(f"ilc/gantry/{topic}", json.dumps(event))


def test_an_event_that_the_database_refuses_holds_nobody_up(
    address: str, finished: CampaignResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a stranger may publish it; the runs after it are stored."""
    from ilc_rt.events import parse_event
    from ilc_rt.monitor import Message

    def said(event: dict[str, Any], cell: str = "hall-3") -> Message:
        return Message(cell, "", event, parse_event(json.dumps(event)))

    (_, start), (_, run), *_ = events(str(finished.library))
    monkeypatch.setattr("ilc_rt.fleet.collect.CELLS_MAX", 3)
    with Collector(address) as collector:
        collector.take(said(start))
        for odd, why in (
            (run | {"index": -1}, "run -1 of hall-3: new row"),
            (run | {"index": 2**40}, "run 1099511627776 of hall-3: integer out of range"),
            (run | {"digest": None}, "run 0 of hall-3: null value"),
        ):
            collector.take(said(odd))
            assert str(collector.refused).startswith(why)
            assert (collector.stored, collector.n_waiting) == (0, 0)
        collector.take(said(run))
        assert collector.stored == 1
        for number in range(10):
            collector.take(said(run, f"stranger-{number}"))
        assert len(collector.unknown) == 2


def test_a_lost_connection_is_opened_again(address: str, finished: CampaignResult) -> None:
    from ilc_rt.events import parse_event
    from ilc_rt.monitor import Message

    cell = "gantry-of-another-hall"
    told = [
        Message(cell, topic, event, parse_event(json.dumps(event)))
        for topic, event in events(str(finished.library))
    ]
    with Collector(address) as collector:
        collector.take(told[1])
        assert (collector.stored, collector.unknown) == (0, {cell})
        collector.take(told[0])
        collector.take(told[1])
        with connect(address) as admin:
            admin.execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                "WHERE pid <> pg_backend_pid() AND datname = current_database()"
            )
        collector.take(told[2])
        assert collector.n_waiting == 1
        collector.take(told[3])
        assert (collector.stored, collector.n_waiting) == (3, 0)
    with FleetLibrary(address) as fleet:
        assert [run["index"] for run in fleet.list(cell)] == [0, 1, 2]
