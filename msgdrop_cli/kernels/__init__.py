"""The learners' update rules once more, compiled: one library of C, and what calls it.

No rule of the paper stands here alone: each is first in `algorithms`, and that is its oracle. What
calls the library is built from weights, shapes and numbers, and knows no learner.
"""
