"""The paper's equations as pure functions of tensors; no state, no randomness of their own."""
