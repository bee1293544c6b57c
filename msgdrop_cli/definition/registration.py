"""What a registration is known by, in the records of the runs that are trained under it."""

from dataclasses import asdict

from msgdrop_cli.definition.run_id import short_hash
from msgdrop_cli.definition.spec import Definition


def registered_as(definition: Definition, environment: str) -> str | None:
    """`broken-links:1a2b3c4d`: the question and a hash of what decides it in one game.

    Everything that can change a verdict there is hashed: looks, alpha, sides, margins, what had
    been seen in this game, and which claims there are. Their words are not. None without any.
    """
    if definition.registration is None:
        return None
    claims = [
        [claim.better, claim.worse, *claim.family, claim.metric, claim.channel.entry]
        for claim in definition.claims
    ]
    rule = asdict(definition.registration.in_game(environment))
    del rule["seen_in"]  # said by `seen`: so names stay those of before there was this key
    table = {**rule, "claims": claims}
    return f"{definition.name}:{short_hash(table)}"
