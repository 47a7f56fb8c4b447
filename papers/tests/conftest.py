"""`ilc` as a process, for the tests of its verb `reproduce`."""

from warm_fixture import ilc, warm  # noqa: F401, they are fixtures
