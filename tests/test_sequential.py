"""The rule of verdicts against its definition: all sets of claims, all paths, one by one."""

from collections.abc import Sequence
from itertools import chain, combinations, product

import numpy as np
import pytest
from scipy.stats import permutation_test

from benchmarks.verdict_level import flips
from msgdrop_cli.analysis.sequential import decided, deciding_looks, speaks_at
from msgdrop_cli.definition.spec import Registration

RULE = Registration(looks=(4, 6, 8), alpha_spent=(0.15, 0.2, 0.3))


def study(seed: int, claims: int, seeds: int, effect: float = 0.0) -> list[list[float]]:
    """Differences that share a part of their noise, the first claim's with an effect."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(claims, seeds)) + rng.normal(size=seeds)
    values[0] += effect
    return [[float(value) for value in row] for row in values.round(1)]


def by_definition(differences: Sequence[Sequence[float]], rule: Registration) -> list[int | None]:
    """Follow every pattern of signs of every set of claims; nothing is shared or left out."""
    claims, seeds = range(len(differences)), len(differences[0])
    patterns = [*product((1.0, -1.0), repeat=seeds)]
    reached = sum(look <= seeds for look in rule.looks)
    begun = [
        n for n, before in zip(rule.looks, (0, *rule.looks), strict=False) if before < rule.seen
    ]

    def statistic(pattern: Sequence[float], members: Sequence[int], look: int) -> float:
        n = rule.looks[look]
        found = []
        for claim in members:
            values = differences[claim][:n]
            size = sum(value**2 for value in values) ** 0.5
            total = sum(s * v for s, v in zip(pattern, values, strict=False))
            found.append((abs(total) if rule.sides == 2 else total) / size if size else 0.0)
        return max(found)

    def crosses_at(members: Sequence[int]) -> float:
        left, gone = list(patterns), 0
        looked = zip(rule.looks, rule.alpha_spent, strict=True)
        before = max((alpha for n, alpha in looked if n in begun), default=0.0)
        for look in range(reached):
            if rule.looks[look] in begun:  # nothing can be registered about it any more
                continue
            left_over = rule.alpha_spent[look] - before
            allowed = int(left_over * len(patterns) - gone + 1e-9)
            ranks = {p: round(statistic(p, members, look), 9) for p in left}
            best = max(
                (c for c in {*ranks.values()} if sum(r >= c for r in ranks.values()) > allowed),
                default=float("inf"),
            )
            crossing = [p for p in left if ranks[p] > best]
            if patterns[0] in crossing:
                return look
            left = [p for p in left if ranks[p] <= best]
            gone = len(patterns) - len(left)
        return float("inf")

    sets = chain.from_iterable(combinations(claims, size) for size in range(1, len(claims) + 1))
    at = {members: crosses_at(members) for members in sets}
    when = [max(at[members] for members in at if claim in members) for claim in claims]
    return [None if look == float("inf") else int(look) for look in when]


@pytest.mark.parametrize(
    "rule",
    [
        RULE,
        Registration(looks=(4, 6, 8), alpha_spent=(0.15, 0.2, 0.3), sides=1),
        Registration(looks=(4, 6, 8), alpha_spent=(0.15, 0.2, 0.3), seen=4),
        Registration(looks=(4, 6, 8), alpha_spent=(0.15, 0.2, 0.3), seen=1),  # a part of look 1
        Registration(looks=(5, 8), alpha_spent=(0.2, 0.3)),
    ],
)
def test_every_set_and_every_path(rule: Registration) -> None:
    """The same decisions at the same looks, with effects and without."""
    found = []
    for trial in range(12):
        differences = study(trial, claims=3, seeds=8, effect=trial % 4)
        when = decided(flips(differences, rule), rule)
        assert when == by_definition(differences, rule), trial
        found += when
    assert len(set(found)) > 2  # None, and more than one look: something is compared


@pytest.mark.parametrize("seeds", [6, 10, 14])
def test_one_claim_at_one_look_is_scipys_permutation_test(seeds: int) -> None:
    """Decided exactly where p is at most alpha, whatever the size of the study."""
    words = set()
    for trial in range(25):
        (values,) = study(trial, 1, seeds, effect=trial / 12.0)
        p = permutation_test(
            (values,), np.mean, permutation_type="samples", n_resamples=np.inf, vectorized=True
        ).pvalue
        for alpha in (0.0125, 0.05, 0.2):
            rule = Registration(looks=(seeds,), alpha_spent=(alpha,))
            when = decided(flips([values], rule), rule)
            assert when == [0 if p <= alpha else None]
            words.add(when[0])
    assert words == {0, None}


def test_each_look_by_scipy() -> None:
    """A path that was decided at a look has a p there of at most what is spent by then."""
    rule = Registration(looks=(6, 10, 14), alpha_spent=(0.035, 0.04, 0.05))
    looks = []
    for trial in range(40):
        (values,) = study(100 + trial, 1, 14, effect=1.4)
        (when,) = decided(flips([values], rule), rule)
        looks.append(when)
        for look in range(3 if when is None else when + 1):
            p = permutation_test(
                (values[: rule.looks[look]],),
                np.mean,
                permutation_type="samples",
                n_resamples=np.inf,
                vectorized=True,
            ).pvalue
            if look == when:
                assert p <= rule.alpha_spent[look]
            else:
                assert p > rule.share(look)  # else the share of this look alone had decided it
    assert {0, 1} <= {*looks}


def test_all_paths_together_spend_no_more_than_alpha() -> None:
    """Of all 2^8 studies that the signs of one family allow, at most 30% decide anything."""
    differences = np.asarray(study(3, claims=2, seeds=8))
    hits = [
        any(look is not None for look in decided(flips((differences * p).tolist(), RULE), RULE))
        for p in product((1.0, -1.0), repeat=8)
    ]
    assert 0.2 < np.mean(hits) <= 0.3


def test_what_was_decided_stays() -> None:
    """More seeds add looks, and change no word of an earlier one."""
    for trial in range(20):
        differences = study(trial, claims=2, seeds=8, effect=2.5)
        early = decided(flips([each[:6] for each in differences], RULE), RULE)
        late = decided(flips(differences, RULE), RULE)
        assert [look for look in early if look is not None] == [
            after for before, after in zip(early, late, strict=True) if before is not None
        ]


def test_a_look_that_was_seen_leaves_nothing_over() -> None:
    """Alpha that six seeds cannot use is kept for the next look, unless they had been seen."""
    values = [1.0] * 9 + [-1.0]  # p is 2 / 64 at six seeds, and 22 / 1024 at ten
    plan = {"looks": (6, 10), "alpha_spent": (0.03, 0.05)}
    kept, gone = Registration(**plan), Registration(**plan, seen=6)  # type: ignore[arg-type]
    assert decided(flips([values], kept), kept) == [1]
    assert decided(flips([values], gone), gone) == [None]


@pytest.mark.parametrize(("seen", "spent"), [(0, 0.3), (4, 0.15)])
def test_alpha_that_is_gone_stays_gone(seen: int, spent: float) -> None:
    """To the last look: of all patterns of signs no more cross any of them than what was left."""
    rule = Registration(looks=(4, 6, 8), alpha_spent=(0.15, 0.2, 0.3), seen=seen)
    values = [2.0**-n for n in range(8)]
    when = [
        decided(flips([[s * v for s, v in zip(signs, values, strict=True)]], rule), rule)
        for signs in product((1.0, -1.0), repeat=8)
    ]
    assert spent - 0.01 < sum(look != [None] for look in when) / 2**8 <= spent


@pytest.mark.parametrize(
    "rule",
    [
        RULE,
        Registration(looks=(6, 10), alpha_spent=(0.02, 0.05)),
        Registration(looks=(6, 10), alpha_spent=(0.02, 0.05), sides=1),
        Registration(looks=(3, 6), alpha_spent=(0.02875, 0.06), seen=3),  # 2 / 2^6 is left
        Registration(looks=(3, 6), alpha_spent=(0.029, 0.06), seen=3),
    ],
)
def test_the_first_look_that_can_decide_does_so_if_all_seeds_agree(rule: Registration) -> None:
    """Exactly as much alpha as the smallest p is enough, whatever the floats make of it."""
    values = [1.0] * rule.looks[-1]
    [when] = decided(flips([values], rule), rule)
    assert deciding_looks(rule)[:1] == ([] if when is None else [rule.looks[when]])


def test_a_look_is_of_the_whole_family() -> None:
    """A claim that comes later would else be judged with the others at a look they had alone."""
    one, other = study(8, claims=2, seeds=8, effect=4.0)
    assert len(flips([one, other], RULE)) == 3
    assert len(flips([one, other[:5]], RULE)) == 1
    assert len(flips([one, other[:3]], RULE)) == 0
    assert decided(flips([one[:3], other[:3]], RULE), RULE) == []


def test_what_is_decided_need_not_go_on() -> None:
    """Its seeds end at the look that decided it, and the others have the later ones."""
    _, other = study(8, claims=2, seeds=8)
    sure = [1.0] * 4  # 2 / 16 at four seeds
    found = flips([sure, other], RULE)
    assert decided(found[:1], RULE) == [0, None]
    assert len(found) == 3
    assert len(flips([sure[:3], other], RULE)) == 0


def test_the_sign_is_that_of_the_look_at_which_the_claim_spoke() -> None:
    """A set with another claim may cross later, when the first one's mean has turned."""
    rule = Registration(looks=(6, 10), alpha_spent=(0.04, 0.1))
    turned = [3.0] * 6 + [-8.0] * 4
    other = [3.0] * 5 + [-3.0] + [50.0] * 4  # as far out as all of one sign, at six seeds
    found = flips([turned, other], rule)
    assert decided(found, rule)[0] == 1
    assert speaks_at(0, found, rule) == 0
    assert sum(turned[:6]) > 0.0 > sum(turned)


@pytest.mark.slow
def test_a_large_family_at_the_last_look_takes_seconds() -> None:
    """Ten claims and twenty seeds: 1,023 sets, 2^19 patterns each."""
    rule = Registration(looks=(6, 10, 14, 20), alpha_spent=(0.015, 0.025, 0.035, 0.05))
    differences = [[value + 1.5 for value in row] for row in study(9, claims=10, seeds=20)]
    assert None not in decided(flips(differences, rule), rule)
