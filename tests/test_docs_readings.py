"""docs/readings.md is made of readings.toml and PAPER.md, and lists every reading once."""

from docs import readings
from msgdrop_cli.definition.readings import all_readings
from tests.markdown import page


def test_the_register_is_up_to_date() -> None:
    """If not: python -m docs.readings."""
    assert readings.PAGE.read_text() == readings.register()


def test_every_reading_is_listed_with_what_it_changes() -> None:
    """A row each, in the order of the file, by a setting of its own."""
    rows = page("readings.md").rows()
    assert [row[0] for row in rows] == [f"`{name}`" for name in all_readings()]
    assert len({row[3] for row in rows}) == len(rows)
