"""msgdrop: train, break, compare and check message-dropout (Kim, Cho, Sung, AAAI-19)."""

__version__ = "0.1.0"
