"""What a registration is known by, in the records of the runs that are trained under it."""

from dataclasses import asdict

from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.definition.spec import Definition


def registered_as(definition: Definition) -> str | None:
    """`broken-links:1a2b3c4d`: the question and a hash of what decides it; None without any.

    Everything that can change a verdict is hashed: looks, alpha, sides, margins, what had been
    seen, and which claims there are. Their words are not.
    """
    if definition.registration is None:
        return None
    claims = [
        [claim.better, claim.worse, *claim.family, claim.metric, claim.channel.entry]
        for claim in definition.claims
    ]
    table = {**asdict(definition.registration), "claims": claims}
    return f"{definition.name}:{short_hash(table)}"
