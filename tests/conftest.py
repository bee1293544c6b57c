"""What every test shares: torch on one thread, because the number of threads changes bits."""

import torch

from msgdrop_cli.engine.arithmetic import THREADS

torch.set_num_threads(THREADS)
