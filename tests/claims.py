"""One claim of somebody's own question, and what is said of it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from msgdrop_cli.analysis.claims import judge_claims
from msgdrop_cli.analysis.summary import summarise
from msgdrop_cli.analysis.verdict import Verdict
from msgdrop_cli.definition.load import load_definition
from msgdrop_cli.definition.spec import Claim, Definition, Registration
from msgdrop_cli.records.store import RunRecord
from tests.fake_runs import write_arm

CLAIM = Claim(
    says="Dropout helps",
    source="l. 1",
    better="md-0.2",
    worse="dcc",
    environment="pursuit-n6",
    metric="catches_per_500",
)
AT_SIX = Registration(looks=(6, 8), alpha_spent=(0.04, 0.05), margin={"catches_per_500": 3.0})
LOW, HIGH = [1, 2, 1, 2, 1, 2], [11, 12, 12, 11, 12, 11]


def asking(*claims: Claim, rule: Registration | None = AT_SIX) -> Definition:
    """A question with these claims."""
    shipped = load_definition("blockwise-vs-elementwise")
    return replace(shipped, name="test", claims=claims, registration=rule)


def verdict_on(
    records: Sequence[RunRecord], claim: Claim = CLAIM, rule: Registration | None = AT_SIX
) -> Verdict:
    """The only verdict on these records."""
    (verdict,) = judge_claims([claim], summarise(records), asking(claim, rule=rule))
    return verdict


def arms(root: Path, better: list[int], worse: list[int], **settings: Any) -> list[RunRecord]:
    """Runs of both variants of the claim, seed by seed."""
    return [
        *write_arm(root, "dcc", worse, **settings),
        *write_arm(root, "md-0.2", better, **settings),
    ]
