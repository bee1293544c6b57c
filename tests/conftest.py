"""What every test shares: torch on one thread, because the number of threads changes bits."""

import torch

torch.set_num_threads(1)
