"""The structs of the C files, as Python fills them; they are compared when the library is loaded.

A field that stands elsewhere in C would not be an error but wrong memory.
"""

import math
from collections.abc import Mapping
from ctypes import (
    CDLL,
    POINTER,
    Structure,
    c_char_p,
    c_float,
    c_int64,
    c_void_p,
    sizeof,
)
from typing import Any

from torch import Tensor

from msgdrop_cli.networks.stacked import Stacked

LANES = 16
"""Numbers in a vector."""
_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-8
"""Adam's, as torch has them."""


def _structure(name: str, **fields: Any) -> type[Structure]:
    """A struct: its fields and their types in order."""
    return type(name, (Structure,), {"_fields_": list(fields.items())})


def _each(kind: Any, names: str) -> dict[str, Any]:
    """Fields of one type; names are separated by spaces."""
    return dict.fromkeys(names.split(), kind)


Layer = _structure("Layer", **_each(c_int64, "inputs outputs weight bias"))
Parameters = _structure("Parameters", **_each(c_void_p, "weights exp_avg exp_avg_sq target"))
Adam = _structure("Adam", **_each(c_float, "step_size root_scale new1 new2 epsilon"))
Outcome = _structure("Outcome", **_each(c_void_p, "loss q"))

DCCNet = _structure(
    "Net",
    **_each(c_int64, "networks blocks own_blocks units message bytes apart"),
    **_each(Layer, "f1 f2 g1 h1 h2"),
)
DCCMemory = _structure(
    "Memory",
    **_each(c_void_p, "obs next_row action reward discount rows shown messages"),
    **_each(c_int64, "agents obs_blocks obs_rows run_rows"),
)
Factors = _structure("Factors", values=c_void_p, **_each(c_int64, "network row block unit"))
DCCRule = _structure("Rule", **_each(c_float, "gamma huber"), adam=Adam, batch_size=c_int64)

MADDPGNet = _structure(
    "Net",
    **_each(c_int64, "runs agents observation action senders masks_actions"),
    **_each(Layer, "a1 a2 f1 f2 g1 h1 h2"),
)
MADDPGMemory = _structure(
    "Memory",
    **_each(c_void_p, "obs next_row action reward discount rows"),
    **_each(c_int64, "obs_rows run_rows"),
)
MADDPGRule = _structure(
    "Rule",
    **_each(c_float, "gamma tau max_norm"),
    **_each(Adam, "critic actor"),
    **_each(c_int64, "batch_size improves_actor"),
)

_SHARED = (Layer, Parameters, Adam, Outcome)
_TABLES = {
    "dcc_fields": (*_SHARED, DCCNet, DCCMemory, Factors, DCCRule),
    "maddpg_fields": (*_SHARED, MADDPGNet, MADDPGMemory, MADDPGRule),
}
"""The tables in which the C files say how their structs lie, and which structs those are."""


class _Field(Structure):
    _fields_ = (("name", c_char_p), ("offset", c_int64), ("size", c_int64))


def check_structs(library: CDLL) -> None:
    """RuntimeError if a struct in C has another size, or a field elsewhere, than it has here."""
    for table, structs in _TABLES.items():
        found = _in_c(library, table)
        expected = {name: place for struct in structs for name, place in _here(struct).items()}
        if wrong := sorted(set(found.items()) ^ set(expected.items())):
            name = wrong[0][0]
            places = f"{found.get(name)} in C, {expected.get(name)} in structs.py"
            raise RuntimeError(f"{table}: {name} (offset, size) is {places}")


def _in_c(library: CDLL, table: str) -> dict[str, tuple[int, int]]:
    """Offset and size of each struct and field, as a C file has them."""
    rows = POINTER(_Field)(_Field.in_dll(library, table))
    found: dict[str, tuple[int, int]] = {}
    while (row := rows[len(found)]).name:
        found[row.name.decode()] = (row.offset, row.size)
    return found


def _here(struct: type[Structure]) -> dict[str, tuple[int, int]]:
    """The same, as Python has them."""
    places = {struct.__name__: (0, sizeof(struct))}
    for name, *_ in struct._fields_:
        field = getattr(struct, name)
        places[f"{struct.__name__}.{name}"] = (field.offset, field.size)
    return places


def layers(weights: Stacked) -> dict[str, Structure]:
    """Where each layer's weight and bias lie in `weights.flat`, by name."""
    return {
        name: Layer(*size, *(part.storage_offset() for part in weights[name]))
        for name, size in weights.layers.items()
    }


def adam(learning_rate: float, step: int) -> Structure:
    """Adam's `step`-th step, from 1."""
    step_size = learning_rate / (1.0 - _BETA1**step)
    root_scale = 1.0 / math.sqrt(1.0 - _BETA2**step)
    return Adam(step_size, root_scale, 1.0 - _BETA1, 1.0 - _BETA2, _EPSILON)


def parameters(parts: Mapping[str, Stacked]) -> Structure:
    """The flat tensors of online, target, exp_avg and exp_avg_sq, which stay where they are."""
    names = ("online", "exp_avg", "exp_avg_sq", "target")
    return Parameters(*(parts[name].flat.data_ptr() for name in names))


def pointer(tensor: Tensor) -> c_void_p:
    """Where a contiguous tensor begins."""
    assert tensor.is_contiguous()
    return c_void_p(tensor.data_ptr())


def outcome(loss: Tensor, q: Tensor) -> Structure:
    """Where losses and Q-values are to be written."""
    return Outcome(pointer(loss), pointer(q))
