"""What `explain` knows of questions: their parts, what is asked under, and what is answered.

All of it stands in the questions' files, in PAPER.md, or beside the verdicts; nothing stands here.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from msgdrop_cli.commands.parts import sources
from msgdrop_cli.commands.parts.sources import notation
from msgdrop_cli.commands.parts.topics.question_keys import Key
from msgdrop_cli.commands.parts.topics.topic import Fact, Topic, sentence
from msgdrop_cli.definition.figures import Figure, all_figures, part_of
from msgdrop_cli.definition.load import list_definitions, load_definition
from msgdrop_cli.definition.overrides import SECTIONS
from msgdrop_cli.definition.readings import Reading, all_readings
from msgdrop_cli.definition.spec import Definition, Profile, Variant
from msgdrop_cli.definition.statements import Statement, read_register


def asked_topics(keys: Sequence[Key]) -> Iterator[Topic]:
    """Questions, figures, variants, profiles, readings and verdicts; `keys` of questions' files."""
    asked = [load_definition(name) for name in list_definitions()]
    yield from map(_question, asked)
    for name, figure in all_figures().items():
        [whole] = [each for each in asked if each.name == figure.question]
        yield _figure(figure, part_of(whole, name, figure))
    yield from _variants(asked)
    [meaning] = [key.meaning for key in keys if key.paths == ("profiles",)]
    yield from _profiles(asked, meaning)
    statements = read_register().statements
    for name, reading in all_readings().items():
        yield _reading(name, reading, [each for each in statements if name in each.readings])
    yield from _verdicts()


def _question(asked: Definition) -> Topic:
    text = f"{asked.title}: {asked.question}"
    return Topic("question", (asked.name,), asked.source, text, tuple(_parts(asked)))


def _figure(figure: Figure, part: Definition) -> Topic:
    facts = (Fact("measures", ", ".join(figure.measures)), *_parts(part))
    where = f"a part of {figure.question}: msgdrop ablate {part.name}"
    return Topic("figure", (part.name,), where, f"{part.title}.", facts)


def _parts(asked: Definition) -> Iterator[Fact]:
    yield Fact("games", ", ".join(asked.environments))
    yield Fact("channels", ", ".join(each.short for each in asked.channels))
    yield Fact("profiles", ", ".join(asked.profiles))
    for known, arm in asked.variants.items():
        yield Fact(f"variant {known}", arm.label)
    says = dict.fromkeys(claim.says for claim in asked.claims)
    for number, each in enumerate(says, start=1):
        yield Fact(f"claim {number}", each)


def _variants(asked: Sequence[Definition]) -> Iterator[Topic]:
    for name in dict.fromkeys(name for each in asked for name in each.variants):
        arms = {each.name: each.variants[name] for each in asked if name in each.variants}
        labels = ", ".join(dict.fromkeys(arm.label for arm in arms.values()))
        facts = tuple(Fact(f"in {question}", _settings(arm)) for question, arm in arms.items())
        yield Topic("variant", (name,), "an arm of a question", f"In tables: {labels}.", facts)


def _profiles(asked: Sequence[Definition], meaning: str) -> Iterator[Topic]:
    for name in dict.fromkeys(name for each in asked for name in each.profiles):
        scales = {each.name: each.profiles[name] for each in asked if name in each.profiles}
        facts = tuple(Fact(f"of {question}", _scale(each)) for question, each in scales.items())
        yield Topic("profile", (name,), f"--profile {name}", meaning, facts)


def _scale(profile: Profile) -> str:
    seeds = notation(profile.seeds)
    sizes = f"seeds={seeds}, evaluation_episodes={profile.evaluation_episodes}"
    return ", ".join(each for each in (sizes, _settings(profile)) if each)


def _reading(name: str, reading: Reading, rows: Sequence[Statement]) -> Topic:
    found = {"sets": _settings(reading)}
    if reading.evaluation_epsilon:
        found = {"evaluates at epsilon": notation(reading.evaluation_epsilon)}
    for row in rows:
        found |= {"the paper says": row.says, "read by default": row.read_as}
        found |= {"if that is wrong": row.if_wrong}
    facts = (
        Fact("games", ", ".join(reading.environments)),
        *(Fact(*each) for each in found.items()),
    )
    return Topic("reading", (name,), f"--reading {name}", sentence(reading.says), facts)


def _verdicts() -> Iterator[Topic]:
    page = sources.module("msgdrop_cli.report.page", "content")
    for word, meaning in sources.entries(page.tree.body, "MEANINGS").items():
        text = sentence(sources.literal(meaning))
        yield Topic("verdict", (word,), "what is said of a claim", text)


def _settings(asked: Variant | Profile | Reading) -> str:
    tables: dict[str, Mapping[str, Any]] = {name: getattr(asked, name) for name in SECTIONS}
    pairs = ((name, *pair) for name, table in tables.items() for pair in table.items())
    return ", ".join(
        f"{key if name == 'algorithm' else f'{name}.{key}'}={notation(value)}"
        for name, key, value in pairs
    )
