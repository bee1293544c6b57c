"""What every test shares: the arithmetic of a training process, because it decides bits."""

from msgdrop_cli.engine import arithmetic

arithmetic.settle()
