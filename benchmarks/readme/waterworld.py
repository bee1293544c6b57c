"""What came out on waterworld: two seeds, which judge nothing."""

from collections.abc import Callable

from benchmarks.readme.studies import difference, expect, paragraph, study, table
from msgdrop_cli.analysis.statistics import mean

_STUDY = "waterworld-half-million"
_WALLS = f"{_STUDY}-stopping-walls"
_LABELS = {"ddpg": "DDPG", "maddpg": "MADDPG", "maddpg-md-0.2": "MADDPG-MD 0.2"}
_TOUCHES = "touches_per_500"
_LAST = 50_000
"""Env steps at the end of the training."""
_PROTOTYPE = (250_000, 300_000)
"""Env steps where a prototype's numbers are known."""


def catches() -> str:
    """Catches and touches of every variant, and of policies that learn nothing."""
    found = study(_STUDY)
    rows = [
        (
            label,
            found.in_training(variant).text(),
            found.after(variant).text(),
            f"{found.after(variant, metric=_TOUCHES).mean:,.0f}",
        )
        for variant, label in _LABELS.items()
    ]
    for says, names in {
        "random play, doing nothing": ("random", "nothing"),
        "all waiting at one place": ("one place",),
        "scripted, seeing everything": ("scripted",),
    }.items():
        caught = dict.fromkeys(f"{found.reference(each):.1f}" for each in names)
        touched = [f"{found.reference(each, _TOUCHES):,.0f}" for each in names]
        rows.append((says, "", ", ".join(caught), ", ".join(touched)))
    return table(("policy", "mean of the training", "greedy, after training", "touches"), rows)


def learnt() -> str:
    """What counts as learning, and how the variants compare."""
    found = study(_STUDY)
    steps = found.arm("ddpg").group.train_env_steps
    last = [
        [
            value
            for each in _LABELS
            for value in found.windows(each, steps - _LAST, steps, m).values()
        ]
        for m in ("catches_per_500", _TOUCHES)
    ]
    ahead = [
        found.verdict("maddpg-md-0.2", each, measure="learning") for each in ("ddpg", "maddpg")
    ]
    greedy = difference(found.verdict("maddpg-md-0.2", "maddpg"))
    expect(
        all(each.interval is not None and each.interval.low > 0.0 for each in ahead)
        and abs(greedy.mean) < 1.0,
        "MADDPG-MD ahead with both seeds while training, level after it",
    )
    before = [f"{mean([*found.windows(each, *_PROTOTYPE).values()]):.1f}" for each in _LABELS]
    parked = found.reference("one place")
    return paragraph(
        f"""Random play catches nothing, parking everybody at one place catches {parked:.1f}, so
        more than 4 catches and more than 450 touches an episode count as learning. Over the last
        {_LAST:,} env steps of their training the six runs make {min(last[0]):.1f} to
        {max(last[0]):.1f} catches and {min(last[1]):,.0f} to {max(last[1]):,.0f} touches in 500
        steps. Over the whole training MADDPG-MD is ahead of DDPG by {difference(ahead[0]).mean:.1f}
        and of MADDPG by {difference(ahead[1]).mean:.1f} catches with both seeds; greedily after it
        MADDPG-MD is level with MADDPG. A prototype's single runs made 9.3 (DDPG), 3.1 (MADDPG) and
        12.8 (MADDPG-MD 0.2) at {_PROTOTYPE[1]:,} steps while training; here it is {before[0]},
        {before[1]} and {before[2]}, the means of two seeds over {_PROTOTYPE[0]:,} to
        {_PROTOTYPE[1]:,}. MADDPG learns better here than in the prototype."""
    )


def walls() -> str:
    """The same with food and poison that stop at walls: a registered reading."""
    turned, stopped = study(_STUDY), study(_WALLS)
    rows = (
        (
            label,
            *(found.in_training(variant).text() for found in (turned, stopped)),
            *(found.after(variant).text() for found in (turned, stopped)),
        )
        for variant, label in _LABELS.items()
    )
    headers = ("in training, they turn back", "they stop", "after it, they turn back", "they stop")
    return table(("policy", *headers), rows)


def walls_turn() -> str:
    """Whether the picture is another one."""
    ahead = {
        name: [
            difference(study(name).verdict("maddpg-md-0.2", each, measure="learning"))
            for each in ("ddpg", "maddpg")
        ]
        for name in (_STUDY, _WALLS)
    }
    first = study(_WALLS).verdict("maddpg-md-0.2", "ddpg")
    expect(
        all(each.interval and each.interval.low > 0.0 for each in ahead[_STUDY])
        and all(
            each.interval and each.interval.low < 0.0 < each.interval.high for each in ahead[_WALLS]
        )
        and (first.difference or 0.0) < 0.0,
        "that MADDPG-MD is ahead in training only where objects turn back",
    )
    turning, stopping = (
        " and ".join(f"{each.mean:.1f}".replace("-0.0", "0.0") for each in ahead[name])
        for name in (_STUDY, _WALLS)
    )
    return paragraph(
        f"""The picture turns: in training MADDPG-MD is ahead of DDPG and MADDPG by {turning}
        catches where objects turn back, with both seeds, and level with them where they stop
        ({stopping}, and the two seeds disagree); after it DDPG is first. Two seeds decide nothing,
        but what the paper says of waterworld may hang on its walls, so both readings are to be
        trained at a million env steps."""
    )


BLOCKS: dict[str, Callable[[], str]] = {
    "waterworld-catches": catches,
    "waterworld-learnt": learnt,
    "waterworld-walls": walls,
    "waterworld-turned": walls_turn,
}
