"""The proof on concealed effects: a simulator of its own, cases drawn from seeds, seals, and a score.

Nothing in here is used by a diagnosis; nothing in here computes a force with the engine's laws.
"""
