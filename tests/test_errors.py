"""What an error message proposes."""

from msgdrop_cli.errors import nearest


def test_what_begins_as_typed_is_nearer_than_what_looks_alike() -> None:
    """`blockwise` means the question that begins so; a slip of the finger the one that is alike."""
    questions = ("architecture", "blockwise-vs-elementwise", "broken-links")
    assert nearest("blockwise", questions) == "did you mean 'blockwise-vs-elementwise'?"
    assert nearest("brokn-links", questions) == "did you mean 'broken-links'?"
    assert nearest("pursuit", ("pursuit-n8", "pursuit-n6")) == "did you mean 'pursuit-n6'?"
    assert nearest("x", questions).startswith("known: architecture, ")
