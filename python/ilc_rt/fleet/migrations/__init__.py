"""The tables of a fleet database, as numbered steps of SQL: ``0001_runs.sql`` and so on.

A step that was released is never changed; a change is the next step.
"""
