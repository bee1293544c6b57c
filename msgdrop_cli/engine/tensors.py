"""Tensors on disk: safetensors only, written in one atomic step, distrusted when read."""

from collections.abc import Mapping
from pathlib import Path

from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from msgdrop_cli.errors import RecordError
from msgdrop_cli.records.files import read_bytes, write_bytes_atomic
from msgdrop_cli.records.seals import Fingerprint, fingerprint

LARGEST_FILE = 2**31
_LARGEST_HEADER = 1_000_000
_MOST_TENSORS = 4_096


def write_tensors(path: Path, tensors: Mapping[str, Tensor]) -> Fingerprint:
    """Write all tensors or, on any fault, nothing; raises RecordError (74).

    Returns the fingerprint of what was meant to be written, not of what the disk made of it.
    """
    content = save({name: t.detach().cpu().contiguous() for name, t in tensors.items()})
    write_bytes_atomic(path, content)
    return fingerprint(content)


def parse_tensors(content: bytes, path: Path) -> dict[str, Tensor]:
    """The tensors in a safetensors file's content; RecordError (2) for anything else."""
    if len(content) < 8 or int.from_bytes(content[:8], "little") > _LARGEST_HEADER:
        raise RecordError(f"{path}: is not a safetensors file of msgdrop")
    try:
        tensors = load(content)
    except (SafetensorError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RecordError(f"{path}: is damaged: {error}") from error
    if len(tensors) > _MOST_TENSORS:
        raise RecordError(f"{path}: holds {len(tensors)} tensors, expected {_MOST_TENSORS} at most")
    return tensors


def read_tensors(path: Path, views: Mapping[str, Tensor] | None = None) -> dict[str, Tensor]:
    """The tensors in `path`; RecordError (2) if it cannot be read or is damaged.

    views: what they are to fit, if that is known; then no file that is larger is read at all.
    """
    largest = LARGEST_FILE
    if views is not None:
        largest = sum(view.nbytes for view in views.values()) + _LARGEST_HEADER
    return parse_tensors(read_bytes(path, largest), path)


def check_finite(tensors: Mapping[str, Tensor], path: Path) -> None:
    """Refuse (RecordError, 2) weights that no sound training leaves behind."""
    if not all(bool(tensor.isfinite().all()) for tensor in tensors.values()):
        raise RecordError(f"{path}: is damaged: it holds weights that are not finite")


def copy_into(views: Mapping[str, Tensor], tensors: Mapping[str, Tensor], path: Path) -> None:
    """Copy each tensor into the view of its name; RecordError (2) unless all fit exactly."""
    check_fit(views, tensors, path)
    for name, view in views.items():
        view.copy_(tensors[name])


def check_fit(
    expected: Mapping[str, Tensor],
    tensors: Mapping[str, Tensor],
    path: Path,
    rows: int | None = None,
) -> None:
    """RecordError (2) unless the names, shapes and types of `tensors` are those of `expected`.

    rows: the first number of each shape, where `expected` has another one.
    """
    if set(expected) != set(tensors):
        odd = min(set(expected) ^ set(tensors))
        raise RecordError(f"{path}: does not fit this run: tensor {odd[:64]!r} is on one side only")
    for name, tensor in expected.items():
        found = tensors[name]
        shape = tuple(tensor.shape) if rows is None else (rows, *tensor.shape[1:])
        if tuple(found.shape) != shape or found.dtype != tensor.dtype:
            raise RecordError(
                f"{path}: does not fit this run: {name!r} is {tuple(found.shape)} {found.dtype},"
                f" expected {shape} {tensor.dtype}"
            )
