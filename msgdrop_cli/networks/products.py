"""The structs of `products.h`, which every update in C shares."""

import math
from ctypes import Structure, c_float, c_int64, c_void_p
from typing import Any

from msgdrop_cli.networks.stacked import Stacked

LANES = 16
"""Numbers in a vector."""
_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-8
"""Adam's, as torch has them."""


def structure(name: str, **fields: Any) -> type[Structure]:
    """A struct of a C file: its fields and their types in order."""
    return type(name, (Structure,), {"_fields_": list(fields.items())})


def each(kind: Any, names: str) -> dict[str, Any]:
    """Fields of one type; names are separated by spaces."""
    return dict.fromkeys(names.split(), kind)


Layer = structure("Layer", **each(c_int64, "inputs outputs weight bias"))
Numbers = structure("Numbers", **each(c_void_p, "weights exp_avg exp_avg_sq target"))
Adam = structure("Adam", **each(c_float, "step_size root_scale beta1 beta2 epsilon"))


def layers(weights: Stacked) -> dict[str, Structure]:
    """Where each layer's weight and bias lie in `weights.flat`, by name."""
    return {
        name: Layer(*size, *(part.storage_offset() for part in weights[name]))
        for name, size in weights.layers.items()
    }


def adam(learning_rate: float, step: int) -> Structure:
    """Adam's `step`-th step, from 1."""
    step_size = learning_rate / (1.0 - _BETA1**step)
    return Adam(step_size, 1.0 / math.sqrt(1.0 - _BETA2**step), _BETA1, _BETA2, _EPSILON)
