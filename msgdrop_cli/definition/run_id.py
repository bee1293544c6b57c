"""The identity of a run: a short hash of everything that its result depends on."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from msgdrop_cli.definition.catalogue import Catalogue
from msgdrop_cli.definition.spec import RunSpec, TrainingSpec
from msgdrop_cli.definition.strict import Where, build


@dataclass(frozen=True, slots=True, kw_only=True)
class _SpecTable:
    environment: Mapping[str, Any]
    algorithm: Mapping[str, Any]
    training: TrainingSpec
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Named:
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Learner:
    learner: str


def run_id(spec: RunSpec) -> str:
    """The first 8 hex digits of the SHA-256 of the spec as canonical JSON, without the cosmetic.

    A field is cosmetic if its metadata says `cosmetic=True`: it never changes a result. One that
    came after runs had been published says `later=True`: at its default it does not stand in the
    table, so that the ids of those runs, and what they are compared with, stay.
    """
    return short_hash(spec_to_dict(spec, cosmetic=False))


def run_ids(spec: RunSpec, seeds: Iterable[int]) -> Iterator[str]:
    """The `run_id` of a spec with each of these seeds; of thousands only the hash is made anew."""
    table = spec_to_dict(spec, cosmetic=False)
    before = _canonical({key: value for key, value in table.items() if key < "seed"})
    after = _canonical({key: value for key, value in table.items() if key > "seed"})
    for seed in seeds:
        yield _digits(f'{before[:-1]},"seed":{seed},{after[1:]}')


def short_hash(table: Mapping[str, Any]) -> str:
    """The first 8 hex digits of the SHA-256 of a table as canonical JSON."""
    return _digits(_canonical(table))


def _canonical(table: Mapping[str, Any]) -> str:
    return json.dumps(table, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _digits(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def spec_to_dict(spec: RunSpec, *, cosmetic: bool = True) -> dict[str, Any]:
    """The spec, ready for JSON: `{"environment": {"name": ...}, "algorithm": {...}, ...}`.

    cosmetic: with the fields that do not enter the run id.
    """
    return {
        "environment": {"name": spec.environment, **_plain(spec.environment_config, cosmetic)},
        "algorithm": {"learner": spec.algorithm, **_plain(spec.algorithm_config, cosmetic)},
        "training": _plain(spec.training, cosmetic),
        "seed": spec.seed,
    }


def spec_from_dict(table: Any, catalogue: Catalogue, where: Where | str = "spec") -> RunSpec:
    """The inverse of `spec_to_dict`; fields that an older record lacks take their defaults.

    Raises DefinitionError where the table names nothing that exists or does not fit.
    """
    where = Where(where) if isinstance(where, str) else where
    read = build(_SpecTable, table, where)
    environment, settings = _split(_Named, read.environment, where.at("environment"))
    algorithm, options = _split(_Learner, read.algorithm, where.at("algorithm"))
    environment_class = catalogue.environment_class(environment.name, settings)
    algorithm_class = catalogue.config_class(algorithm.learner)
    return RunSpec(
        environment=environment.name,
        environment_config=build(environment_class, settings, where.at("environment")),
        algorithm=algorithm.learner,
        algorithm_config=build(algorithm_class, options, where.at("algorithm")),
        training=read.training,
        seed=read.seed,
    )


def _split(cls: Any, table: Mapping[str, Any], where: Where) -> tuple[Any, dict[str, Any]]:
    """The part of `table` that `cls` names, and the rest."""
    names = {field.name for field in fields(cls)}
    head = {key: value for key, value in table.items() if key in names}
    rest = {key: value for key, value in table.items() if key not in names}
    return build(cls, head, where), rest


def _plain(value: Any, cosmetic: bool) -> Any:
    """`value` in JSON's own types; TypeError for what has no place in a Config."""
    if is_dataclass(value):
        kept = (f for f in fields(value) if cosmetic or not f.metadata.get("cosmetic", False))
        entries = {field: getattr(value, field.name) for field in kept}
        return {
            field.name: _plain(entry, cosmetic)
            for field, entry in entries.items()
            if not (field.metadata.get("later", False) and entry == field.default)
        }
    if isinstance(value, Mapping):
        return {str(key): _plain(entry, cosmetic) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, cosmetic) for entry in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a Config holds plain values, not {type(value).__name__}")
