"""The libraries of many cells in one PostgreSQL database: sync, collection, reading, fetching.

Verbs and dashboards may import it. It needs psycopg, the extra ``fleet``; a controller never does.
"""

from ilc_rt.fleet.collect import Collector
from ilc_rt.fleet.fetch import Fetched, fetch
from ilc_rt.fleet.reader import FleetLibrary
from ilc_rt.fleet.sync import Synced, pull, push

__all__ = ["Collector", "Fetched", "FleetLibrary", "Synced", "fetch", "pull", "push"]
